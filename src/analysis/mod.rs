//! Energy and trajectory errors, comparisons of learned and exact Lagrangians.
