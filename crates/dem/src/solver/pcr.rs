//! Preconditioned conjugate residuals on the contact space: `(J M^-1 J^T + S) x = f`, matrix-free.
//!
//! docs/theory/solvers.md, box 2b. S is diagonal; so is the preconditioner `P = 1 / (diag(J M^-1 J^T) + S)`.
//! A row whose S is infinite has P = 0: its unknown keeps the value that it starts with, exactly.

use crate::body::Body;
use crate::contact_set::ContactSet;
use crate::lanes::{Lanes, Reg, widest};
use crate::solver::components::{
    COUNT, Components, add_scaled, collect, dot, scale_and_add, spread,
};

/// The part of a row vector that each of its eight numbers shares: normal, tangential, rolling, torsion.
const PART: [usize; COUNT] = [0, 1, 1, 1, 2, 2, 2, 3];
/// Share of the first residual, squared, below which nothing but rounding is left.
const ROUNDING: f64 = f64::EPSILON * f64::EPSILON;

/// One number for the normal, the tangential, the rolling and the torsion rows of each contact of a batch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Diagonal(pub [Lanes; 4]);

impl Diagonal {
    pub const ZERO: Self = Self([Lanes::ZERO; 4]);
}

/// The linear system of one Newton step, batch by batch.
#[derive(Clone, Debug, Default)]
pub(super) struct System {
    /// S, 0 where it is infinite.
    pub shift: Vec<Diagonal>,
    /// P, 0 where S is infinite.
    pub inverse: Vec<Diagonal>,
    /// f.
    pub right: Vec<Components>,
    /// x: at first 0, or its known value where S is infinite; then the solution.
    pub unknown: Vec<Components>,
}

impl System {
    /// Iterates `count` times, or until rounding is all that is left; returns the passes over the contacts.
    pub fn solve(&mut self, sets: &[&mut ContactSet], bodies: usize, count: usize) -> usize {
        let Self { shift, inverse, right, unknown } = self;
        let mut scratch = vec![Body::default(); bodies];
        let mut image = vec![Components::ZERO; right.len()]; // K z
        let mut apply = |x: &[Components], image: &mut [Components]| {
            scratch.fill(Body::default());
            spread(sets, x, &mut scratch);
            collect(sets, &mut scratch, image);
            add_weighted(image, 1.0, shift, x);
        };

        apply(unknown, &mut image);
        scale_and_add(&mut image, -1.0, right);
        let mut residual = vec![Components::ZERO; right.len()]; // z = P (f - K x)
        add_weighted(&mut residual, 1.0, inverse, &image);
        apply(&residual, &mut image);
        let mut direction = residual.clone(); // p
        let mut direction_image = image.clone(); // K p
        let mut rho = dot(&residual, &image);
        let enough = ROUNDING * rho;
        for done in 0..count {
            let curvature = dot_weighted(&direction_image, inverse);
            // Also false for a NaN.
            if !(rho > enough && curvature > 0.0) {
                return done + 2;
            }
            let alpha = rho / curvature;
            add_scaled(unknown, alpha, &direction);
            add_weighted(&mut residual, -alpha, inverse, &direction_image);
            apply(&residual, &mut image);
            let before = std::mem::replace(&mut rho, dot(&residual, &image));
            let beta = rho / before;
            scale_and_add(&mut direction, beta, &residual);
            scale_and_add(&mut direction_image, beta, &image);
        }
        count + 2
    }
}

widest! {
    /// `a <- a + factor D b`.
    fn add_weighted<W>(a: &mut [Components], factor: f64, diagonal: &[Diagonal], b: &[Components]) {
        let factor = Reg::<W>::splat(factor);
        for ((a, diagonal), b) in a.iter_mut().zip(diagonal).zip(b) {
            for ((a, b), part) in a.0.iter_mut().zip(&b.0).zip(PART) {
                (Reg::load(a) + factor * Reg::load(&diagonal.0[part]) * Reg::load(b)).store(a);
            }
        }
    }
}

widest! {
    /// `a . D a`.
    fn dot_weighted<W>(a: &[Components], diagonal: &[Diagonal]) -> f64 {
        let mut sum = Reg::<W>::splat(0.0);
        for (a, diagonal) in a.iter().zip(diagonal) {
            for (a, part) in a.0.iter().zip(PART) {
                let a = Reg::load(a);
                sum = sum + a * Reg::load(&diagonal.0[part]) * a;
            }
        }
        let mut lanes = Lanes::ZERO;
        sum.store(&mut lanes);
        lanes.0.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::blocks::Blocks;
    use crate::contact::{ContactKey, ContactLaw};
    use crate::contact_set::{BodyKind, Laws};
    use crate::lanes::LANES;

    /// Axis of the normal of each contact of the triangle.
    const AXES: [usize; 3] = [0, 1, 2];

    /// A triangle of unequal grains, one batch for each contact. The normals are axes, whatever triangle that is, so
    /// that tangential vectors are those without one component.
    fn triangle() -> ContactSet {
        let listed = [(0, 1), (0, 2), (1, 2)].map(|(i, partner)| ContactKey { i, partner });
        let mut set = ContactSet::default();
        let laws = Laws::Each(|contact: &ContactKey| ContactLaw {
            inverse_mass: [contact.i, contact.partner].map(|grain| [1.0, 2.0, 0.5][grain as usize]),
            lever: [0.3, 0.7],
            sliding_friction: 0.5,
            rolling_friction: 0.1,
            torsional_friction: 0.05,
            compliance: 0.0,
            rolling_speed: 0.0,
        });
        set.rebuild(&listed, &Blocks::default(), 3, BodyKind::Grain, &laws);
        for (batch, axis) in set.batches.iter_mut().zip(AXES) {
            let mut normal = [0.0; 3];
            normal[axis] = 1.0;
            batch.normal.set(0, normal);
        }
        set
    }

    /// The numbers of the first lane of every batch.
    fn numbers(vector: &[Components]) -> Vec<f64> {
        vector.iter().flat_map(|rows| rows.0.map(|row| row.0[0])).collect()
    }

    /// 1 where a vector of contacts may have a number, 0 where it would be tangential or rolling along the normal.
    fn allowed(batch: usize, row: usize) -> f64 {
        f64::from(u8::from(row != 1 + AXES[batch] && row != 4 + AXES[batch]))
    }

    fn unit(batches: usize, index: usize) -> Vec<Components> {
        let (batch, row) = (index / COUNT, index % COUNT);
        let mut vector = vec![Components::ZERO; batches];
        vector[batch].0[row].0[0] = allowed(batch, row);
        vector
    }

    /// J M^-1 J^T as a matrix, column by column.
    fn matrix(sets: &[&mut ContactSet]) -> DMatrix<f64> {
        let batches: usize = sets.iter().map(|set| set.batches.len()).sum();
        let size = COUNT * batches;
        let mut matrix = DMatrix::zeros(size, size);
        for index in 0..size {
            let mut bodies = vec![Body::default(); 4];
            let mut image = vec![Components::ZERO; batches];
            spread(sets, &unit(batches, index), &mut bodies);
            collect(sets, &mut bodies, &mut image);
            matrix.set_column(index, &DVector::from_vec(numbers(&image)));
        }
        matrix
    }

    #[test]
    fn the_operator_is_symmetric_and_has_the_stated_blocks() {
        let mut set = triangle();
        assert_eq!(set.batches.len(), 3);
        let law = set.laws[set.batches[0].law as usize].clone();
        let matrix = matrix(&[&mut set]);
        assert!((&matrix - matrix.transpose()).norm() < 1e-14);
        let eigenvalues = matrix.clone().symmetric_eigenvalues();
        assert!(eigenvalues.min() > -1e-13, "{eigenvalues}");
        // The normal of the first contact is x: A_n, A_t and A_r on y and z, and A_r about x.
        let stiffness = 1.0 / law.compliance_n.0[0];
        assert!((matrix[(0, 0)] - stiffness).abs() < 1e-14);
        assert!((matrix[(2, 2)] - 3.5 * stiffness).abs() < 1e-14);
        for row in [5, 6, 7] {
            assert!((matrix[(row, row)] - 1.0 / law.compliance_r.0[0]).abs() < 1e-14);
        }
        assert_eq!((matrix[(1, 1)], matrix[(4, 4)]), (0.0, 0.0));
    }

    /// A system with a right side of everything, shifts that make it regular, and one known unknown.
    fn system(sets: &[&mut ContactSet]) -> System {
        let mut system = System::default();
        for number in 0..sets[0].batches.len() {
            let mut right = Components::ZERO;
            for (index, row) in right.0.iter_mut().enumerate() {
                row.0[0] = allowed(number, index) * (1.0 + (COUNT * number + index) as f64).sin();
            }
            let mut diagonal = Diagonal::ZERO;
            for (part, row) in diagonal.0.iter_mut().enumerate() {
                row.0[0] = 0.5 + 0.3 * part as f64;
            }
            let mut inverse = diagonal;
            inverse.0.iter_mut().for_each(|row| row.0[0] = 1.0 / (2.0 + row.0[0]));
            let mut unknown = Components::ZERO;
            if number == 1 {
                inverse.0[0].0[0] = 0.0;
                diagonal.0[0].0[0] = 0.0;
                unknown.0[0].0[0] = 0.25;
            }
            system.shift.push(diagonal);
            system.inverse.push(inverse);
            system.right.push(right);
            system.unknown.push(unknown);
        }
        system
    }

    /// Largest entry of f - K x over the rows that are solved.
    fn left(matrix: &DMatrix<f64>, system: &System) -> f64 {
        let x = DVector::from_vec(numbers(&system.unknown));
        let f = DVector::from_vec(numbers(&system.right));
        let rest = f - matrix * &x;
        let mut worst = 0.0_f64;
        for (index, value) in rest.iter().enumerate() {
            let (number, part) = (index / COUNT, PART[index % COUNT]);
            if system.inverse[number].0[part].0[0] > 0.0 {
                let shift = system.shift[number].0[part].0[0];
                worst = worst.max((value - shift * x[index]).abs());
            }
        }
        worst
    }

    #[test]
    fn conjugate_residuals_solve_it_and_keep_what_is_known() {
        let mut set = triangle();
        let sets = [&mut set];
        let matrix = matrix(&sets);
        let mut before = f64::INFINITY;
        for count in [1, 4, 16, 64] {
            let mut system = system(&sets);
            let passes = system.solve(&sets, 4, count);
            assert!(passes <= count + 2);
            assert_eq!(system.unknown[1].0[0].0[0], 0.25);
            let now = left(&matrix, &system);
            assert!(now < before || now < 1e-13, "{count}: {now} after {before}");
            before = now;
            // Lanes without a contact stay empty.
            assert!(
                (1..LANES).all(|lane| system.unknown[0].0.iter().all(|row| row.0[lane] == 0.0))
            );
        }
        assert!(before < 1e-13, "{before}");
    }
}
