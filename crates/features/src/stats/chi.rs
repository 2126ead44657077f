//! Degrees of freedom, shift and scale of a chi distribution fitted to the radius.
//!
//! \\[ f(r; k, b, A) = \frac{2^{1-k/2}}{A\,\Gamma(k/2)} \left(\frac{r-b}{A}\right)^{k-1}
//! \exp\left(-\frac{(r-b)^2}{2A^2}\right), \qquad r \ge b \\]
//!
//! Maximum likelihood over 1 ≤ k ≤ 100, b ≤ min(r), A > 0: the density of `scipy.stats.chi(df, loc,
//! scale)`, with bounds. Without the lower one the likelihood has no maximum (k < 1, b → min r makes
//! it infinite); without the upper one it often has none either (data skewed to the left, such as
//! a uniform disc, push k → ∞, b → -∞ towards the normal distribution). Both are derived in
//! `docs/theory/statistics.md`. Equal radii give k = 1, b = r, A = 0.
//!
//! Source: the paper, Summary Statistic Extraction.

mod fit;
mod gamma;
mod log_sum;

pub use fit::{ChiFit, MAX_DF, MIN_DF};

use super::{Behaviour, Statistic};

/// Degrees of freedom of the chi distribution of the radius.
pub const CHI_DF: Statistic = Statistic {
    name: "chi_df",
    unit: "-",
    doc: "degrees of freedom of the chi distribution fitted to the radius, within [1, 100]",
    behaviour: Behaviour::NUMBER,
    value: |points| points.chi().df,
};

/// Shift of the chi distribution of the radius.
pub const CHI_SHIFT: Statistic = Statistic {
    name: "chi_shift",
    unit: "m",
    doc: "shift b of the chi distribution fitted to the radius",
    behaviour: Behaviour::LENGTH,
    value: |points| points.chi().shift,
};

/// Scale of the chi distribution of the radius.
pub const CHI_SCALE: Statistic = Statistic {
    name: "chi_scale",
    unit: "m",
    doc: "scale A of the chi distribution fitted to the radius",
    behaviour: Behaviour::LENGTH,
    value: |points| points.chi().scale,
};
