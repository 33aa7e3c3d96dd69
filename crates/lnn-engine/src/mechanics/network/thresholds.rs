//! Initial values and bounds of network Lagrangians; limits of model files stand in `file`, whose format they belong to.

// Bounds of the structures. `cargo test -p lnn-engine -- network` checks the signatures that follow from them.

/// Smallest diagonal element of a triangular factor, and smallest lapse; its square is added to the eigenvalues of a rectangle.
pub(super) const LEAST_DIAGONAL: f64 = 1e-3;
/// Number of rows of a rectangle for every spatial coordinate.
pub(super) const RECTANGLE_ROWS: usize = 3;

// Initial values. `cargo test --test suite -- training` checks that trainings from them learn.

/// Initial biases of the diagonal of a triangle: `softplus(1) = 1.31`.
pub(super) const INITIAL_DIAGONAL: f64 = 1.0;
/// Initial factor of a constant mass matrix that is added to a known Lagrangian.
pub(super) const BESIDE_KNOWN: f64 = 0.01;
/// Initial scale of the argument of dynamic tanh (Zhu et al. 2025).
pub(super) const INITIAL_TANH_SCALE: f64 = 0.5;
/// Factor of the output weights under `Initialization::NearZero`.
pub(super) const NEAR_ZERO_FACTOR: f64 = 0.01;
/// Initial `gamma` of every unit of a dissipation function: the friction coefficient starts at `ln(1 + e^-5) = 0.0067`.
pub(super) const INITIAL_FRICTION: f64 = -5.0;
/// Initial parameter of the coefficients of joint friction: `softplus(-3) = 0.049` of the size.
pub(super) const INITIAL_STRENGTH: f64 = -3.0;
/// Initial knee and fall of joint friction, as a fraction of the velocity scale.
pub(super) const INITIAL_SPEED: f64 = 0.05;
