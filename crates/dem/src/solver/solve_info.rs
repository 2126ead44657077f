//! What a solve took and what it left.

/// What a solve took and what it left.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SolveInfo {
    /// Passes over all contacts: Gauss-Seidel sweeps and iterations of the linear solver.
    pub sweeps: usize,
    /// Fastest closing `-(w_n + b)` of a contact at the last evaluation `[m/s]`.
    pub closing: f64,
    /// Newton steps that the guard has damped or replaced.
    pub guarded: usize,
    /// Whether the method's own measure of success was missed when its iterations were used up.
    pub unconverged: bool,
}
