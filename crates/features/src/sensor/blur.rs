//! Gaussian blur that neither uses nor fills missing pixels.

/// Half width of the kernel in standard deviations; the weight cut off is 6e-5 (scipy uses 4 too).
const TRUNCATE: f64 = 4.0;

/// Normalised convolution of a row-major field: G*(w f) / G*w with w = 1 where there is data and 0 where there is NaN
/// or no image, at the pixels that have data. `keep_going` is asked at every row: none when it says no.
///
/// # Reference
/// Knutsson & Westin 1993, doi:10.1109/CVPR.1993.341081.
pub(super) fn normalised(
    field: &[f64],
    width: usize,
    sigma_px: f64,
    keep_going: &dyn Fn() -> bool,
) -> Option<Vec<f64>> {
    let kernel = half_kernel(sigma_px);
    let weight: Vec<f64> = field.iter().map(|f| f64::from(u8::from(!f.is_nan()))).collect();
    let weighted: Vec<f64> = field.iter().map(|&f| if f.is_nan() { 0.0 } else { f }).collect();
    let blurred = |field: &[f64]| {
        let rows = along_rows(field, width, &kernel, keep_going)?;
        along_columns(&rows, width, &kernel, keep_going)
    };
    let (numerator, denominator) = (blurred(&weighted)?, blurred(&weight)?);
    let pixels = field.iter().zip(numerator.iter().zip(&denominator));
    Some(pixels.map(|(f, (n, d))| if f.is_nan() { f64::NAN } else { n / d }).collect())
}

/// Weights of the distances 0, 1, 2, … `[px]`; the common factor cancels in the quotient.
fn half_kernel(sigma_px: f64) -> Vec<f64> {
    let reach = (TRUNCATE * sigma_px).round() as usize;
    (0..=reach).map(|i| (-0.5 * (i as f64 / sigma_px).powi(2)).exp()).collect()
}

/// Convolution along each row; outside the image is 0.
fn along_rows(
    field: &[f64],
    width: usize,
    kernel: &[f64],
    keep_going: &dyn Fn() -> bool,
) -> Option<Vec<f64>> {
    let mut out = vec![0.0; field.len()];
    for (from, to) in field.chunks_exact(width).zip(out.chunks_exact_mut(width)) {
        if !keep_going() {
            return None;
        }
        // Taps outside, pixels inside: the inner loops are plain sums of slices.
        for (distance, &k) in kernel.iter().enumerate().take(width) {
            add_scaled(&mut to[distance..], &from[..width - distance], k);
            if distance > 0 {
                add_scaled(&mut to[..width - distance], &from[distance..], k);
            }
        }
    }
    Some(out)
}

/// Convolution along each column; outside the image is 0.
fn along_columns(
    field: &[f64],
    width: usize,
    kernel: &[f64],
    keep_going: &dyn Fn() -> bool,
) -> Option<Vec<f64>> {
    let height = field.len() / width;
    let mut out = vec![0.0; field.len()];
    for (row, to) in out.chunks_exact_mut(width).enumerate() {
        if !keep_going() {
            return None;
        }
        for (distance, &k) in kernel.iter().enumerate() {
            if let Some(above) = row.checked_sub(distance) {
                add_scaled(to, &field[above * width..], k);
            }
            let below = row + distance;
            if distance > 0 && below < height {
                add_scaled(to, &field[below * width..], k);
            }
        }
    }
    Some(out)
}

/// `to += k from`, as far as `to` goes.
fn add_scaled(to: &mut [f64], from: &[f64], k: f64) {
    for (t, f) in to.iter_mut().zip(from) {
        *t += k * f;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The double sum, as it is written.
    fn direct(field: &[f64], width: usize, sigma: f64) -> Vec<f64> {
        let (reach, height) = ((TRUNCATE * sigma).round() as usize, field.len() / width);
        (0..field.len())
            .map(|p| {
                let (mut n, mut d) = (0.0, 0.0);
                for q in (0..field.len()).filter(|&q| !field[q].is_nan()) {
                    let dx = (p % width).abs_diff(q % width);
                    let dy = (p / width).abs_diff(q / width);
                    if dx <= reach && dy <= reach {
                        let k = (-0.5 * ((dx * dx + dy * dy) as f64) / (sigma * sigma)).exp();
                        n += k * field[q];
                        d += k;
                    }
                }
                assert_eq!(height * width, field.len());
                if field[p].is_nan() { f64::NAN } else { n / d }
            })
            .collect()
    }

    #[test]
    fn equals_the_double_sum() {
        let mut field: Vec<f64> = (0..70).map(|i| f64::from(i * i % 13)).collect();
        for hole in [0, 11, 12, 13, 37] {
            field[hole] = f64::NAN;
        }
        for sigma in [0.3, 1.0, 2.5, 20.0] {
            let expected = direct(&field, 10, sigma);
            let blurred = normalised(&field, 10, sigma, &|| true).unwrap();
            for (got, expected) in blurred.iter().zip(expected) {
                assert!((got - expected).abs() < 1e-12 || (got.is_nan() && expected.is_nan()));
            }
        }
    }

    #[test]
    fn it_is_given_up_when_it_is_told_to() {
        let (field, left) = (vec![1.0; 200], std::cell::Cell::new(0_usize));
        // 20 rows, along rows and along columns, of the field and of its weights.
        for (rows, is_whole) in [(79, false), (80, true)] {
            left.set(rows);
            let keep_going = || left.replace(left.get().saturating_sub(1)) > 0;
            assert_eq!(normalised(&field, 10, 1.0, &keep_going).is_some(), is_whole);
        }
    }
}
