//! Arguments to library calls.
