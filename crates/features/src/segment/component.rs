//! Connected patches of a mask.

/// Clears the patches of fewer than `min_px` pixels; neighbours share an edge or a corner.
pub(super) fn remove_small(mask: &mut [bool], width: usize, min_px: usize) {
    if min_px > 1 {
        keep_patches(mask, width, |patch| patch.len() >= min_px);
    }
}

/// Clears the patches without a peak: noise wanders over a threshold, grains stand well above it.
///
/// # Reference
/// Thresholds in pairs: Canny 1986, doi:10.1109/TPAMI.1986.4767851.
pub(super) fn remove_low(mask: &mut [bool], width: usize, is_peak: impl Fn(usize) -> bool) {
    keep_patches(mask, width, |patch| patch.iter().any(|&pixel| is_peak(pixel)));
}

fn keep_patches(mask: &mut [bool], width: usize, is_kept: impl Fn(&[usize]) -> bool) {
    for patch in patches(mask, width).into_iter().filter(|patch| !is_kept(patch)) {
        for pixel in patch {
            mask[pixel] = false;
        }
    }
}

/// The pixels of each patch of a mask of `width` columns.
pub(super) fn patches(mask: &[bool], width: usize) -> Vec<Vec<usize>> {
    let Some(height) = mask.len().checked_div(width) else { return Vec::new() };
    let mut seen = vec![false; mask.len()];
    let mut found = Vec::new();
    for start in 0..mask.len() {
        if !mask[start] || seen[start] {
            continue;
        }
        let mut patch = vec![start];
        seen[start] = true;
        let mut next = 0;
        while let Some(&pixel) = patch.get(next) {
            next += 1;
            let (u, v) = (pixel % width, pixel / width);
            for row in v.saturating_sub(1)..(v + 2).min(height) {
                for column in u.saturating_sub(1)..(u + 2).min(width) {
                    let neighbour = row * width + column;
                    if mask[neighbour] && !seen[neighbour] {
                        seen[neighbour] = true;
                        patch.push(neighbour);
                    }
                }
            }
        }
        found.push(patch);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Letters are set pixels.
    fn mask(picture: &str) -> Vec<bool> {
        picture.chars().filter(|c| !c.is_whitespace()).map(|c| c != '.').collect()
    }

    #[test]
    fn keeps_patches_that_are_large_enough() {
        let before = "a..b. .a..b ....b c....";
        for (min_px, after) in [
            (1, before),
            (2, "a..b. .a..b ....b ....."),
            (3, "...b. ....b ....b ....."),
            (4, "....................."),
        ] {
            let mut got = mask(before);
            remove_small(&mut got, 5, min_px);
            assert_eq!(got, mask(after)[..20], "min {min_px}");
        }
    }

    #[test]
    fn keeps_patches_that_have_a_peak() {
        let picture = "a..bb a...B ..... C....";
        let letters: Vec<char> = picture.chars().filter(|c| !c.is_whitespace()).collect();
        let mut got = mask(picture);
        remove_low(&mut got, 5, |pixel| letters[pixel].is_uppercase());
        assert_eq!(got, mask("...bb ....B ..... C....")[..20]);
    }
}
