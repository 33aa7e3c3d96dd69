//! Numerical stress suite: 38 cases, each judged by double-double numbers, integers or closed forms.
//!
//! `cargo test --test suite stress -- --nocapture` prints `case | name | precision | worst R | where`; with
//! `--include-ignored` the long variants too. R is an error in units of rounding times the condition of the quantity
//! (the unit is in the row's name where it is another). R below 30 is rounding, above it is the algorithm; cases with
//! a limit of their own keep it.
//!
//! | case | held by |
//! |---|---|
//! | 1 tails of the activations | `ops::activation::tests::tails_f32`, `tails_f64` |
//! | 2 GELU'' near sqrt 2, GELU''' near 0 | here; `ops::activation::tests::gelu_changes_sign_where_it_should` |
//! | 3 reflections | here; `ops::activation::tests::reflections` |
//! | 4 kinks | here; `forward::tests::kinks_follow_the_convention` |
//! | 5 one number that is not finite | here; `training::objective::one_number_that_is_not_finite_is_named_and_never_reaches_the_weights`, `mechanics::relativity::speeds_of_light_are_refused` |
//! | 6 angles of any size | here; `scalar::primitive::tests::angles_of_any_size`, `scalar::lanes::tests::slices_are_accurate` |
//! | 7 pendula far from 0 | `mechanics::systems::every_output_is_within_rounding_of_double_double` (every fourth state is shifted by each of 2^10, 2^20, 2^40) |
//! | 8 integer polynomials | here; `autodiff::tape::integer_polynomials_are_exact` |
//! | 9 adjoint identity, symmetry | here; `autodiff::tape::adjoint_identity` |
//! | 10 one code, three precisions | `mechanics::systems::double_double_agrees_with_an_independent_table` (1e-28), `every_output_is_within_rounding_of_double_double`, `scalar::dd::tests::independent_values` |
//! | 11 long chains, wide fans, reuse | here for programs; `autodiff::tape::long_chains_wide_fans_and_reuse` for the tape |
//! | 12 dead branches | `autodiff::tape::dead_branch_gives_no_nan`, `autodiff::program::dead_lanes_and_nan`, `forward::tests::dead_branch_leaves_no_trace` |
//! | 13 gradients of the loss | here against double-double; `training::objective::the_gradient_is_that_of_the_whole_loss` and its neighbours against reverse mode |
//! | 14 solve, backward | `linalg::solve_is_backward_stable_on_lapack_types` |
//! | 15 solve, forward | the same |
//! | 16 tiny and vanishing pivots | here; `linalg::inertia_by_pivots_agrees_with_the_spectrum` |
//! | 17 eigenvectors | `linalg::eigenvectors_are_orthogonal_and_eigenvalues_right` |
//! | 18 closed forms | here; `linalg::closed_forms_of_small_eigenvalues` |
//! | 19 repeated eigenvalues | here; `training::penalties::repeated_negative_eigenvalues_have_a_basis_free_gradient` |
//! | 20 gradient of det at singular M | here; `linalg::gradient_of_the_determinant_is_right_where_it_vanishes` |
//! | 21 minors out of range | here; `training::penalties::products_of_scales_beyond_the_range_keep_sign_and_size`, `linalg::scale_does_not_matter` |
//! | 22 singular M | here; `linalg::singular_and_foreign_rows_are_reported_and_the_others_solved`, `training::objective::a_singular_mass_matrix_stops_or_is_left_out_by_choice` |
//! | 23 positive definite M | here; `training::penalties::positive_definite_matrices_cost_nothing` |
//! | 24 Lorentzian M | here; `training::penalties::lorentzian_matrices_cost_nothing_and_one_flipped_sign_does` |
//! | 25 M -> s M | `training::penalties::penalties_scale_as_they_should`, `the_penalty_fades_where_eps_dominates`, `products_of_scales_beyond_the_range_keep_sign_and_size` |
//! | 26 lower median | here for batches; `training::penalties::scales_are_lower_medians`, `gradients_are_slopes` (scales held fixed) |
//! | 27 barely negative eigenvalues | here; `training::penalties::the_gradient_at_a_singular_minor_is_the_adjugate` |
//! | 28 analytic systems | `mechanics::systems::every_output_is_within_rounding_of_double_double`, `closed_forms_agree_in_every_precision` |
//! | 29 energy of any L | here; `mechanics::random::energy_is_conserved` |
//! | 30 gauge and factor | here; `mechanics::random::gauge_and_scale_change_no_acceleration` |
//! | 31 charts | here; `mechanics::relativity::kepler_moves_alike_in_both_charts`, `geodesics_of_anti_de_sitter_space_are_circles` |
//! | 32 ends of charts | `mechanics::relativity::the_loss_is_graceful_where_charts_end`, `the_loss_is_graceful_towards_the_speed_of_light_and_towards_rest`, `a_horizon_is_an_error_and_its_inside_is_not` |
//! | 33 order | here for the adaptive methods; `rollout::integrators::measured_orders_are_the_theoretical_ones` |
//! | 34 tolerance | here; `rollout::tests::error_follows_tolerance` |
//! | 35 energy over long runs | here in f32; `rollout::integrators::rounding_errors_of_the_energy_walk_at_random` and its long variant in f64 |
//! | 36 many rows | here; `scalar::sum::tests::ten_million_tenths_in_single_precision` |
//! | 37 splits and threads | here; `training::objective::the_same_seed_gives_the_same_bytes_on_any_number_of_threads`, `training::presets`; stopped and resumed: `training::checkpoints::stopping_after_any_step_changes_nothing` |
//! | 38 subnormal weights | here |

mod activations;
mod derivatives;
mod eigen;
mod failures;
mod integrators;
mod mechanics;
mod minimum_norm;
mod objective;
mod penalties;
mod record;
mod scalars;
mod solve;
mod training;
