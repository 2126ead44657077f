use super::*;
use crate::{Material, Preset, Scene, Simulation};

/// A drop that has just landed: pairs and ground contacts, sticking and slipping.
fn landed(material: Material, seconds: f64) -> Simulation {
    let mut scene = Scene::drop(0.005);
    scene.grains.count = 40;
    scene.preset = Preset::Fast;
    scene.material = material;
    let mut simulation = Simulation::new(&scene, 3).unwrap();
    simulation.advance(seconds);
    simulation
}

fn material(sliding: f64, rolling: f64) -> Material {
    Material::new(sliding, rolling, 0.4).unwrap()
}

#[test]
fn the_solution_satisfies_the_law_and_the_equations() {
    // Grains as rough as the last may lock so that sweeps circle: 10 ms earlier and later they leave 2e-3 and 4e-4.
    for (mu_s, mu_r, seconds) in
        [(0.0, 0.0, 0.08), (0.3, 0.0, 0.08), (0.5, 0.1, 0.08), (1.0, 1.0, 0.08)]
    {
        let problem = landed(material(mu_s, mu_r), seconds).contact_problem().unwrap();
        let touching = problem.contacts.iter().filter(|c| c.impulse[0] > 0.0).count();
        assert!(touching >= 10, "{mu_s} {mu_r}: {touching} of {}", problem.contacts.len());
        let residual = problem.residual();
        assert!(residual <= CONVERGED * problem.scale(), "{mu_s} {mu_r}: {residual}");
        // W r + q, block by block, is J v + b.
        let mut y = problem.right_hand_side();
        for DelassusBlock { row, column, block } in problem.delassus() {
            y[row] += block * problem.contacts[column].impulse;
        }
        let expected = problem.relative_velocities(&problem.velocities());
        for (y, expected) in y.iter().zip(&expected) {
            assert!((y - expected).amax() < 1e-13);
        }
    }
}

#[test]
fn a_wrong_impulse_is_seen() {
    let problem = landed(material(0.5, 0.1), 0.06).contact_problem().unwrap();
    let touching = problem.contacts.iter().position(|c| c.impulse[0] > 0.0).unwrap();
    for row in 0..6 {
        let mut wrong = problem.clone();
        wrong.contacts[touching].impulse[row] += 1e-6;
        assert!(wrong.residual() > 1e-7, "row {row}: {}", wrong.residual());
    }
}

#[test]
fn the_delassus_matrix_is_symmetric_and_its_blocks_are_those_of_the_theory() {
    let problem = landed(material(0.5, 0.1), 0.06).contact_problem().unwrap();
    let blocks = problem.delassus();
    let find = |row, column| blocks.iter().find(|b| (b.row, b.column) == (row, column)).unwrap();
    for block in &blocks {
        let mirror = find(block.column, block.row);
        assert!((block.block - mirror.block.transpose()).amax() < 1e-15);
    }
    // Equal grains: 2, 7, 5/4 for a pair; 1, 7/2, 5/2 at a wall, where rolling and sliding couple by 5/2.
    for (number, contact) in problem.contacts.iter().enumerate() {
        let own = find(number, number).block;
        let (diagonal, coupling) = match contact.partner {
            Partner::Grain(_) => ([2.0, 7.0, 7.0, 1.25, 1.25, 1.25], 0.0),
            Partner::Wall(_) => ([1.0, 3.5, 3.5, 2.5, 2.5, 2.5], 2.5),
        };
        assert!((own.diagonal() - Vector6::from(diagonal)).amax() < 1e-14, "{own}");
        assert!((own[(1, 4)].abs() - coupling).abs() < 1e-14, "{own}");
        assert!((own[(0, 1)], own[(0, 4)]) == (0.0, 0.0) || own[(0, 1)].abs() < 1e-15);
    }
}

#[test]
fn freezing_a_substep_does_not_disturb_it() {
    let mut looked_at = landed(material(0.5, 0.1), 0.05);
    let mut left_alone = looked_at.clone();
    assert!(looked_at.contact_problem().unwrap().sweeps > 0);
    looked_at.advance(0.02);
    left_alone.advance(0.02);
    assert_eq!(looked_at.positions(), left_alone.positions());
    assert_eq!(looked_at.velocities(), left_alone.velocities());
}

#[test]
fn a_resting_grain_is_carried_by_its_weight() {
    // One grain at rest on the ground: r_n = g dt, nothing else.
    let mut scene = Scene::drop(0.0);
    scene.grains.count = 1;
    scene.start =
        crate::Start::Ball { height: 0.0, solid_fraction: 0.6, jitter: 0.0, turned: false };
    let problem = Simulation::new(&scene, 0).unwrap().contact_problem().unwrap();
    let contact = &problem.contacts[0];
    assert_eq!((problem.contacts.len(), contact.partner), (1, Partner::Wall(0)));
    assert!((contact.impulse[0] - 9.81 * problem.dt).abs() < 1e-17);
    assert_eq!(problem.velocities()[0].amax(), 0.0);
    assert_eq!(problem.delassus().len(), 1);
}
