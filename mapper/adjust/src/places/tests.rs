//! Places of the generator's room, seen again.

use std::sync::LazyLock;

use mba_synth::{CameraMotion, DepthSensor, NoiseModel, SynthConfig, SynthSequence};
use mba_tracker::geometry::{RigidTransform, so3};
use nalgebra::Vector3;

use super::{PlaceDescriptor, PlaceError, PlaceIndex};

const PLACES: usize = 12;

/// All round the room with a blur of 20 px in images of 640 columns: a view every 30 degrees.
fn config() -> SynthConfig {
    SynthConfig {
        motion: CameraMotion::Loop,
        frames: PLACES + 1,
        width: 160,
        height: 120,
        frame_rate: 1.0,
        exposure_seconds: 0.02,
        mean_blur_px: 5.0,
        noise: Some(NoiseModel::default()),
        depth: DepthSensor::StructuredLight,
        ..SynthConfig::default()
    }
}

static ROUND: LazyLock<SynthSequence> = LazyLock::new(|| SynthSequence::new(config()).unwrap());

fn describe(rgb: &[u8]) -> PlaceDescriptor {
    PlaceDescriptor::new(rgb, &ROUND.camera()).unwrap()
}

fn pose(place: usize) -> RigidTransform {
    ROUND.world_from_camera(ROUND.timestamp(place))
}

/// The views of the round, sharp.
static STORED: LazyLock<PlaceIndex> = LazyLock::new(|| {
    let mut index = PlaceIndex::default();
    (0..PLACES).for_each(|place| index.push(100 + place, describe(&ROUND.render_sharp(place))));
    index
});

#[test]
fn blurred_noisy_and_darker_views_are_recognised() {
    let darker = SynthSequence::new(SynthConfig { gain: 0.6, ..config() }).unwrap();
    for place in 0..PLACES {
        let query = describe(&darker.render_frame(place).rgb);
        let candidates = STORED.candidates(&query, 2, -1.0, |_| true);
        let [first, second] = candidates[..] else { panic!("{candidates:?}") };
        println!("{place}: {:.3}, next {} {:.3}", first.similarity, second.id - 100, second.similarity);
        assert_eq!(first.id, 100 + place);
        assert!(first.similarity > 0.75 && second.similarity < first.similarity - 0.1, "{candidates:?}");
        assert!(first.stored_from_query.rotation.angle() < 0.06, "{candidates:?}");
    }
}

#[test]
fn turned_views_are_recognised_and_their_rotation_is_told() {
    let turns = [[0.0, 0.1], [0.0, -0.1], [0.07, 0.0], [-0.07, 0.0], [0.06, -0.08]];
    for place in 0..PLACES {
        let [x, y] = turns[place % turns.len()];
        let stored_from_query =
            RigidTransform::new(so3::exp(&Vector3::new(x, y, 0.0)), Vector3::new(0.03, -0.02, 0.05));
        let rgb = ROUND.render_view(&pose(place).compose(&stored_from_query));
        let candidates = STORED.candidates(&describe(&rgb), 1, 0.6, |_| true);
        assert_eq!(candidates[0].id, 100 + place, "{candidates:?}");
        let guess = candidates[0].stored_from_query.rotation;
        let error = guess.angle_to(&stored_from_query.rotation);
        println!("{place}: {:.3}, {error:.3} rad off", candidates[0].similarity);
        // Near things move with the step aside as with a turn of 0.05 rad. A wrong sign costs 0.14 or more.
        assert!(error < 0.07, "place {place}: {error} rad off");
    }
}

#[test]
fn a_turn_alone_is_measured_to_a_degree() {
    for (place, [x, y]) in [(0, [0.0, 0.13]), (3, [0.05, 0.04]), (7, [-0.06, -0.1])] {
        let turn = RigidTransform::new(so3::exp(&Vector3::new(x, y, 0.0)), Vector3::zeros());
        let rgb = ROUND.render_view(&pose(place).compose(&turn));
        let (similarity, guess) = describe(&rgb).compare(&describe(&ROUND.render_sharp(place)));
        assert!(similarity > 0.85, "place {place}: {similarity}");
        assert!(guess.rotation.angle_to(&turn.rotation) < 0.0175, "place {place}: {guess:?}");
    }
}

#[test]
fn candidates_are_eligible_alike_enough_and_in_order() {
    let query = describe(&ROUND.render_sharp(4));
    let all = STORED.candidates(&query, PLACES, -1.0, |_| true);
    assert_eq!((all.len(), all[0].id), (PLACES, 104));
    assert!((all[0].similarity - 1.0).abs() < 1e-5);
    assert!(all.windows(2).all(|pair| pair[0].similarity >= pair[1].similarity));
    assert_eq!(STORED.candidates(&query, 3, -1.0, |id| id != 104), all[1..4]);
    assert_eq!(STORED.candidates(&query, 9, all[2].similarity, |_| true), all[..3]);
    let mut twice = STORED.clone();
    twice.push(3, query.clone());
    let ids: Vec<_> = twice.candidates(&query, 2, 0.5, |_| true).iter().map(|found| found.id).collect();
    assert_eq!(ids, [3, 104]);
}

#[test]
fn images_without_structure_or_of_another_size_are_no_place() {
    let camera = ROUND.camera();
    let grey = PlaceDescriptor::new(&vec![90; 3 * 160 * 120], &camera).unwrap();
    assert!(STORED.candidates(&grey, 9, 0.01, |_| true).is_empty());
    assert_eq!(
        PlaceDescriptor::new(&[0; 30], &camera),
        Err(PlaceError::Length { got: 30, expected: 57_600, width: 160, height: 120 })
    );
    let tiny = mba_tracker::geometry::PinholeCamera { width: 16, height: 12, ..camera };
    assert!(matches!(PlaceDescriptor::new(&[0; 576], &tiny), Err(PlaceError::TooSmall { .. })));
}
