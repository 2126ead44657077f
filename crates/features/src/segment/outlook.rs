//! What of an image besides its points tells whether the formation was seen whole and alone.

use std::collections::BTreeMap;

use super::component::patches;
use super::edge::depth_in;
use super::formation::Formation;
use super::part::Part;

/// A second heap is higher than so many grains, and three standard deviations of the ground. Of 60 pours of the default
/// prior none had many grains apart that were higher than 1.7.
const HEAP_HEIGHT: f64 = 2.0;
/// Pixels of it, at least: a lone one may be a fault.
pub(super) const HEAP_PIXELS: usize = 3;

/// A pixel without data is in a hole if so many of the eight around it have none, or more; of a fifth that are missing
/// at random one in a hundred is.
const BLIND_AROUND: usize = 4;

impl Formation {
    /// How near the formation comes to the edge of the image, over half the image's shorter side: 0 where it reaches
    /// it, 1 where it is in the middle alone `[-]`.
    pub fn margin(&self) -> f64 {
        let Some(depth) = depth_in(self.mask.len(), self.width) else { return 0.0 };
        let grains = (0..self.mask.len()).filter(|&pixel| self.mask[pixel]);
        let least = grains.map(depth).min().unwrap_or(0);
        2.0 * least as f64 / self.width.min(self.height) as f64
    }

    /// Share of the formation's volume that its largest patch holds: near 1 of a heap, little of scattered grains
    /// `[-]`.
    pub fn body_share(&self) -> f64 {
        let parts = self.patches_by_volume();
        let all: f64 = parts.iter().map(|(part, _)| part.volume).sum();
        parts.first().map_or(0.0, |(body, _)| body.volume / all)
    }

    /// Whether the edge of the image cuts the formation off: its largest patch reaches it.
    pub fn is_cut_off(&self) -> bool {
        let Some(depth) = depth_in(self.mask.len(), self.width) else { return false };
        self.largest_patch().is_some_and(|patch| patch.into_iter().any(|pixel| depth(pixel) == 0))
    }

    /// Share of the outline of the formation's largest patch beyond which nothing is seen: the edge of the image, a
    /// border that is ignored, what is above the greatest height, and holes, but for single pixels `[-]`.
    pub fn hidden_share(&self) -> f64 {
        let Some(patch) = self.largest_patch() else { return 0.0 };
        let (width, height) = (self.width as isize, self.height as isize);
        let at = |(u, v): (isize, isize)| {
            let is_inside = u >= 0 && v >= 0 && u < width && v < height;
            is_inside.then_some((v * width + u) as usize)
        };
        let is_blind = |place| at(place).is_none_or(|pixel| self.heights[pixel].is_none());
        let is_hidden = |(u, v)| {
            let around = (-1..=1).flat_map(|du| (-1..=1).map(move |dv| (u + du, v + dv)));
            is_blind((u, v)) && around.filter(|&place| is_blind(place)).count() > BLIND_AROUND
        };
        let mut outline = BTreeMap::new();
        for pixel in patch {
            let (u, v) = ((pixel % self.width) as isize, (pixel / self.width) as isize);
            for place in [(u - 1, v), (u + 1, v), (u, v - 1), (u, v + 1)] {
                if at(place).is_none_or(|pixel| !self.mask[pixel]) {
                    outline.entry(place).or_insert_with(|| is_hidden(place));
                }
            }
        }
        let hidden = outline.values().filter(|&&hidden| hidden).count();
        hidden as f64 / outline.len().max(1) as f64
    }

    /// The pixels of the formation itself, the patch of most volume: what stands apart is left out.
    fn largest_patch(&self) -> Option<Vec<usize>> {
        self.patches_by_volume().into_iter().next().map(|(_, patch)| patch)
    }

    /// The patches of grains, that of most volume first, and what parts they are.
    fn patches_by_volume(&self) -> Vec<(Part, Vec<usize>)> {
        let all = patches(&self.mask, self.width).into_iter();
        let mut all: Vec<_> = all.map(|patch| (self.part(&patch), patch)).collect();
        all.sort_by(|(a, _), (b, _)| b.volume.total_cmp(&a.volume));
        all
    }

    /// Share of the image that carries data, less a border all around that has none `[-]`.
    pub fn seen_share(&self) -> f64 {
        let Some(depth) = depth_in(self.heights.len(), self.width) else { return 0.0 };
        let seen = |pixel: &usize| self.heights[*pixel].is_some();
        let border = (0..self.heights.len()).filter(seen).map(&depth).min().unwrap_or(0);
        let inside = (0..self.heights.len()).filter(|&pixel| depth(pixel) >= border);
        let (mut all, mut with_data) = (0.0, 0.0);
        for pixel in inside {
            all += 1.0;
            with_data += f64::from(u8::from(seen(&pixel)));
        }
        with_data / f64::max(all, 1.0)
    }

    /// What else stands as high and as wide as a heap of grains of `diameter` `[m]`, apart from the largest patch.
    pub fn other_heaps(&self, diameter: f64) -> Vec<Part> {
        let others = self.patches_by_volume().into_iter().skip(1);
        let others = others
            .filter(|(part, patch)| patch.len() >= HEAP_PIXELS && self.is_heap(part, diameter));
        others.map(|(part, _)| part).collect()
    }

    /// Heaps of grains of `diameter` `[m]` beyond the square of ground that was asked for: they were left out.
    pub fn left_out_heaps(&self, diameter: f64) -> Vec<Part> {
        self.left_out.iter().filter(|part| self.is_heap(part, diameter)).copied().collect()
    }

    fn is_heap(&self, part: &Part, diameter: f64) -> bool {
        part.height > HEAP_HEIGHT * diameter + 3.0 * self.ground_sd && part.is_many(diameter)
    }

    /// The part that a patch of pixels is.
    pub(super) fn part(&self, patch: &[usize]) -> Part {
        let area = self.resolution.0 * self.resolution.1;
        let heights = || patch.iter().filter_map(|&pixel| self.heights[pixel]);
        Part { volume: area * heights().sum::<f64>(), height: heights().fold(0.0, f64::max) }
    }
}

#[cfg(test)]
mod tests {
    use crate::{Formation, HeightMap, Region, Segmentation, Threshold, segment_height_map};

    const SIDE: usize = 80;
    const DIAMETER: f64 = 4e-3;

    /// Cones on level ground of 2 mm to a pixel: middle `[px]`, height and radius `[m]`; the first columns have no
    /// data.
    fn seen(cones: &[([f64; 2], f64, f64)], blind: usize) -> Formation {
        let height_threshold = Threshold::Absolute(1e-3);
        let settings = Segmentation { height_threshold, ..Segmentation::default() };
        segment_height_map(&map(cones, blind), &settings).unwrap()
    }

    fn map(cones: &[([f64; 2], f64, f64)], blind: usize) -> HeightMap {
        let (mut z, step) = (Vec::new(), 2e-3);
        for row in 0..SIDE {
            for column in 0..SIDE {
                let height = |&([u, v], height, radius): &([f64; 2], f64, f64)| {
                    let away = step * (column as f64 - u).hypot(row as f64 - v);
                    height * (1.0 - away / radius)
                };
                let top = cones.iter().map(height).fold(0.0, f64::max);
                z.push(if column < blind { f64::NAN } else { top });
            }
        }
        HeightMap::new(SIDE, SIDE, step, step, z).unwrap()
    }

    #[test]
    fn a_region_is_seen_as_if_there_were_no_more() {
        let (pile, rim) = (([40.0, 40.0], 0.02, 0.03), ([8.0, 40.0], 0.02, 0.015));
        let region = Some(Region { x: 20, y: 15, width: 45, height: 50 });
        let height_threshold = Threshold::Absolute(1e-3);
        let settings = Segmentation { height_threshold, region, ..Segmentation::default() };
        let inside = segment_height_map(&map(&[pile, rim], 0), &settings).unwrap();
        assert_eq!((inside.width, inside.height), (45, 50));
        assert!(inside.seen_share() == 1.0 && !inside.is_cut_off());
        assert!(inside.other_heaps(DIAMETER).is_empty());
        let (alone, both) = (seen(&[pile], 0), seen(&[pile, rim], 0));
        assert!((inside.volume - alone.volume).abs() < 1e-12 && both.volume > 1.1 * alone.volume);
        let beyond = Some(Region { x: 40, y: 0, width: 45, height: 50 });
        let settings = Segmentation { region: beyond, ..settings };
        let error = segment_height_map(&map(&[pile], 0), &settings).unwrap_err().to_string();
        assert_eq!(error, "right edge of a region [px] must be in [1, 80], got 85");
    }

    #[test]
    fn a_pile_in_the_middle_is_seen_whole_and_alone() {
        let pile = seen(&[([40.0, 40.0], 0.02, 0.03)], 0);
        assert!((pile.margin() - 0.64).abs() < 0.05, "{}", pile.margin());
        assert!(!pile.is_cut_off() && pile.other_heaps(DIAMETER).is_empty());
        assert_eq!(pile.seen_share(), 1.0);
        assert_eq!(pile.body_share(), 1.0);
        // A cone of half the height and half the radius holds an eighth.
        let both = seen(&[([40.0, 40.0], 0.02, 0.03), ([70.0, 70.0], 0.01, 0.015)], 0);
        assert!((both.body_share() - 8.0 / 9.0).abs() < 0.02, "{}", both.body_share());
    }

    #[test]
    fn what_hides_a_part_is_known() {
        let (pile, height_threshold) = (([40.0, 40.0], 0.02, 0.03), Threshold::Absolute(1e-3));
        assert_eq!(seen(&[pile], 0).hidden_share(), 0.0);
        // No data up to a column through it, and a border as wide as that.
        let blind = seen(&[pile], 36);
        assert!(blind.hidden_share() > 0.2 && !blind.is_cut_off(), "{}", blind.hidden_share());
        let aside = seen(&[([18.0, 40.0], 0.02, 0.03)], 0);
        let z = aside.heights.iter().map(|seen| seen.unwrap()).collect();
        let mut map = HeightMap::new(SIDE, SIDE, 2e-3, 2e-3, z).unwrap();
        let own = Segmentation { height_threshold, ..Segmentation::default() };
        let read = |settings| segment_height_map(&map, &settings).unwrap().hidden_share();
        assert_eq!(read(own.clone()), 0.0);
        assert!(read(Segmentation { border_px: 10, ..own.clone() }) > 0.1);
        // A hand over it is no data, and hides.
        assert!(read(Segmentation { max_height: Some(0.012), ..own.clone() }) > 0.1);
        // Single pixels that are missing hide nothing.
        map.z.iter_mut().step_by(3).for_each(|z| *z = f64::NAN);
        assert_eq!(segment_height_map(&map, &own).unwrap().hidden_share(), 0.0);
    }

    #[test]
    fn what_is_cut_off_blind_or_not_alone_is_known() {
        let cut = seen(&[([2.0, 40.0], 0.02, 0.03)], 0);
        assert!(cut.is_cut_off() && cut.margin() == 0.0);
        let blind = seen(&[([60.0, 40.0], 0.02, 0.03)], 40);
        assert!((blind.seen_share() - 0.5).abs() < 1e-12 && !blind.is_cut_off());
        // A grain by itself is none.
        let foot = ([70.0, 10.0], 0.03, 0.02);
        let two = seen(&[([36.0, 44.0], 0.02, 0.03), foot, ([8.0, 8.0], 4e-3, 4e-3)], 0);
        let [heap] = two.other_heaps(DIAMETER)[..] else { panic!("one heap") };
        assert!((heap.height - 0.03).abs() < 1e-3, "{heap:?}");
        let cone = std::f64::consts::PI / 3.0 * 0.02 * 0.02 * 0.03;
        assert!((heap.volume / cone - 1.0).abs() < 0.1, "{heap:?} {cone}");
    }
}
