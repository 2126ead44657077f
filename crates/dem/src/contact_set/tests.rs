//! What a list of contacts keeps from the one before.

use super::*;

fn law(number: f64) -> ContactLaw {
    ContactLaw {
        inverse_mass: [1.0, 1.0],
        lever: [0.5, 0.5],
        sliding_friction: number,
        rolling_friction: 0.1,
        torsional_friction: 0.05,
        compliance: 0.0,
        rolling_speed: 0.0,
    }
}

/// Every pair of `grains`: the densest list there is.
fn all_pairs(grains: u32) -> Vec<ContactKey> {
    (0..grains)
        .flat_map(|i| (i + 1..grains).map(move |partner| ContactKey { i, partner }))
        .collect()
}

#[test]
fn lanes_of_a_batch_share_no_grain_and_no_contact_is_lost() {
    // 80 grains that all touch need more colours than a mask holds.
    let listed = all_pairs(80);
    let mut set = ContactSet::default();
    set.rebuild(
        &listed,
        &Blocks::default(),
        80,
        BodyKind::Grain,
        &Laws::Each(|_: &ContactKey| law(0.5)),
    );
    assert_eq!(set.len(), listed.len());
    let mut found = Vec::new();
    for batch in &set.batches {
        let mut grains: Vec<u32> =
            batch.lanes().flat_map(|lane| [batch.i[lane], batch.j[lane]]).collect();
        found.extend(batch.lanes().map(|lane| (batch.i[lane], batch.j[lane])));
        grains.sort_unstable();
        assert!(grains.windows(2).all(|pair| pair[0] != pair[1]));
    }
    found.sort_unstable();
    assert_eq!(found, listed.iter().map(|c| (c.i, c.partner)).collect::<Vec<_>>());
    assert_eq!(set.laws.len(), 1);
}

#[test]
fn one_law_of_all_is_what_each_would_have_had() {
    let (mut one, mut each) = (ContactSet::default(), ContactSet::default());
    let (listed, blocks) = (all_pairs(9), Blocks::default());
    let all: Laws<fn(&ContactKey) -> ContactLaw> = Laws::One(law(0.5));
    one.rebuild(&listed, &blocks, 9, BodyKind::Grain, &all);
    each.rebuild(&listed, &blocks, 9, BodyKind::Grain, &Laws::Each(|_: &ContactKey| law(0.5)));
    // One that comes between two lists may differ.
    for set in [&mut one, &mut each] {
        set.append(ContactKey { i: 0, partner: 8 }, false, law(0.7));
    }
    assert_eq!(one.laws, each.laws);
    let of = |set: &ContactSet| set.batches.iter().map(|b| (b.i, b.j, b.law)).collect::<Vec<_>>();
    assert_eq!(of(&one), of(&each));
}

#[test]
fn impulses_and_laws_follow_their_contact() {
    let mut set = ContactSet::default();
    let friction = |contact: &ContactKey| f64::from(contact.i) + 0.01 * f64::from(contact.partner);
    let laws = Laws::Each(|contact: &ContactKey| law(friction(contact)));
    set.rebuild(&all_pairs(9), &Blocks::default(), 9, BodyKind::Grain, &laws);
    for batch in &mut set.batches {
        for lane in batch.lanes() {
            batch.lambda_n.0[lane] = f64::from(batch.i[lane] * 100 + batch.j[lane]);
        }
    }
    // The next list has fewer contacts in another order.
    let mut fewer: Vec<ContactKey> = all_pairs(9).into_iter().filter(|c| c.partner != 4).collect();
    fewer.reverse();
    set.rebuild(&fewer, &Blocks::default(), 9, BodyKind::Grain, &laws);
    assert_eq!(set.len(), fewer.len());
    for batch in &set.batches {
        for lane in batch.lanes() {
            let (i, partner) = (batch.i[lane], batch.j[lane]);
            assert_eq!(batch.lambda_n.0[lane], f64::from(i * 100 + partner));
            let expected = friction(&ContactKey { i, partner });
            assert_eq!(set.laws[batch.law as usize].sliding_friction.0[lane], expected);
        }
    }
}
