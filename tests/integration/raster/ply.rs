//! Files of Gaussians: round trips, other writers' forms, damaged files.

use std::path::Path;

use mba_mapper::gaussians::{
    ForViewers, Gaussian, Gaussians, PlyError, format_ply, format_ply_for_viewers, parse_ply, read_ply,
    write_ply,
};
use mba_tests::transfer_scene::Uniform;

fn random_map(count: usize) -> Gaussians {
    let mut uniform = Uniform::new(5);
    let mut numbers = |low, high| uniform.within(low, high) as f32;
    (0..count)
        .map(|_| {
            let rotation = [(); 4].map(|()| numbers(-1.0, 1.0));
            let norm = rotation.iter().map(|q| q * q).sum::<f32>().sqrt();
            Gaussian {
                mean: [(); 3].map(|()| numbers(-5.0, 5.0)),
                log_scale: [(); 3].map(|()| numbers(-8.0, 1.0)),
                rotation: rotation.map(|q| q / norm),
                opacity_logit: numbers(-5.0, 5.0),
                colour: [(); 3].map(|()| numbers(-0.1, 1.3)),
            }
        })
        .collect()
}

fn assert_same(got: &Gaussians, want: &Gaussians, tolerance: f32) {
    assert_eq!(got.len(), want.len());
    for (k, (got, want)) in got.planes().iter().zip(want.planes()).enumerate() {
        for (got, want) in got.iter().zip(want) {
            assert!((got - want).abs() <= tolerance, "plane {k}: {got} instead of {want}");
        }
    }
}

fn parse(text: &[u8]) -> Result<Gaussians, PlyError> {
    parse_ply(Path::new("map.ply"), text)
}

fn message(text: &[u8]) -> String {
    parse(text).expect_err("the file is damaged").to_string()
}

#[test]
fn a_map_returns_from_its_file() {
    let map = random_map(1000);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.ply");
    write_ply(&path, &map).unwrap();
    assert_same(&read_ply(&path).unwrap(), &map, 5e-7);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "a partial file is left");
}

#[test]
fn the_file_has_the_size_and_colours_of_the_usual_form() {
    let white = Gaussian { colour: [1.0; 3], rotation: [2.0, 0.0, 0.0, 0.0], ..Gaussian::default() };
    let bytes = format_ply(&[white].into_iter().collect());
    let body = &bytes[bytes.len() - 17 * 4..];
    assert!(bytes[..bytes.len() - 17 * 4].ends_with(b"end_header\n"));
    let number = |k: usize| f32::from_le_bytes(body[4 * k..4 * k + 4].try_into().unwrap());
    // White is display colour 1, i.e. the coefficient (1 - 0.5)/0.28209479.
    assert!((number(6) - 1.772_453_9).abs() < 1e-6, "{}", number(6));
    assert_eq!(number(13), 1.0, "the quaternion is not of unit length");
}

#[test]
fn colours_for_viewers_do_not_change_the_map_that_is_read() {
    let broken = Gaussian { mean: [f32::NAN, 0.0, 0.0], ..Gaussian::default() };
    let map: Gaussians =
        [broken].into_iter().chain((0..100).filter_map(|k| random_map(100).get(k))).collect();
    let planes = [0.0_f32, 0.25, 1.0].map(|value| (0..101).map(|k| value * k as f32 / 100.0).collect());
    let log_scales = [-3.0, -2.0, -1.0].map(|scale| vec![scale; 101]);
    let comments = vec!["Vertical axis: y".to_owned()];
    let bytes = format_ply_for_viewers(&map, &ForViewers { colours: planes, log_scales, comments });
    let (read, plain) = (parse(&bytes).unwrap(), parse(&format_ply(&map)).unwrap());
    assert_eq!(read.len(), 100);
    let bits = |map: &Gaussians| map.planes().iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&read), bits(&plain));
    assert!(bytes.starts_with(b"ply\nformat binary_little_endian 1.0\ncomment Vertical axis: y\n"));
    // The last record, as programs read it that know nothing of the properties behind the usual ones.
    let body = &bytes[bytes.len() - 23 * 4..];
    let number = |k: usize| f32::from_le_bytes(body[4 * k..4 * k + 4].try_into().unwrap());
    for (k, display) in [(6, 0.0), (7, 0.25), (8, 1.0_f32)] {
        assert!((0.282_094_79 * number(k) + 0.5 - display).abs() < 1e-6, "channel {k}: {}", number(k));
    }
    assert_eq!([10, 11, 12].map(number), [-3.0, -2.0, -1.0]);
    // With only some of the map's own properties there are none.
    let partly = String::from_utf8_lossy(&bytes).find("mba_dc_1").unwrap();
    let mut bytes = bytes;
    bytes[partly..partly + 3].copy_from_slice(b"abc");
    assert!(parse(&bytes).unwrap().planes()[11].iter().all(|red| red.abs() < 1e-6));
}

/// Properties in another order, of other types, with others in between, behind another element.
const TEXT: &str = "ply\r\nformat ascii 1.0\ncomment by hand\nelement camera 1\nproperty float fx\n\
    element vertex 1\nproperty double rot_3\nproperty float rot_2\nproperty float rot_1\nproperty float rot_0\n\
    property uchar label\nproperty float opacity\nproperty float f_dc_2\nproperty float f_dc_1\n\
    property float f_dc_0\nproperty float f_rest_0\nproperty float scale_2\nproperty float scale_1\n\
    property float scale_0\nproperty float z\nproperty float y\nproperty int x\nelement face 2\n\
    property list uchar int vertex_indices\nend_header\n\
    500\n0.4 0.3 0.2 0.1 7 -1.5 1.7724539 0 -1.7724539 9 -3 -2 -1 0.3 0.2 -4\n3 0 1 2\n3 0 1 2\n";

#[test]
fn properties_come_in_any_order() {
    let want = Gaussian {
        mean: [-4.0, 0.2, 0.3],
        log_scale: [-1.0, -2.0, -3.0],
        rotation: [0.1, 0.2, 0.3, 0.4],
        opacity_logit: -1.5,
        colour: [0.0, 0.214_041_14, 1.0],
    };
    assert_same(&parse(TEXT.as_bytes()).unwrap(), &[want].into_iter().collect(), 1e-6);
}

#[test]
fn damaged_files_are_named() {
    assert!(message(b"solid").contains("not a PLY file"));
    assert!(
        message(b"ply\nformat ascii 1.0\nelement vertex 3\n").contains("header line 4: expected end_header")
    );
    let without = |text: &str| message(TEXT.replace(text, "").as_bytes());
    assert!(without("property float opacity\n").contains("no property \"opacity\""));
    assert!(without("format ascii 1.0\n").contains("expected a line \"format\""));
    let with = |from: &str, to: &str| message(TEXT.replace(from, to).as_bytes());
    assert!(
        with("vertex 1", "vertex many")
            .contains("expected a number of elements, found \"element vertex many\"")
    );
    assert!(with("double", "quad").contains("header line 7: expected a known type"));
    assert!(with("-1.5", "nan").contains("vertex 0: opacity is \"nan\""));
    assert!(with(" 0.2 -4", "").contains("vertex 0: y is \"\""), "{}", with(" 0.2 -4", ""));
    assert!(with("ascii", "binary_big_endian").contains("expected format ascii"));
}

#[test]
fn a_short_file_is_refused_without_reserving_what_it_announces() {
    let mut bytes = format_ply(&random_map(3));
    bytes.pop();
    assert!(message(&bytes).contains("announces 3 vertices, the file ends after 2"));
    let huge = TEXT.replace("vertex 1", "vertex 9000000000000000000");
    assert!(
        message(huge.as_bytes()).contains("vertex 1:") || message(huge.as_bytes()).contains("ends after")
    );
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 18446744073709551615\n";
    let rest = TEXT.split_once("element vertex 1\n").unwrap().1.split_once("element face").unwrap().0;
    assert!(message(format!("{header}{rest}end_header\n").as_bytes()).contains("ends after 0"));
}

#[test]
fn what_no_renderer_draws_is_not_written() {
    let mut map = random_map(3);
    let broken = Gaussian { opacity_logit: f32::NAN, ..map.get(1).unwrap() };
    map.set(1, &broken);
    assert_eq!(parse(&format_ply(&map)).unwrap().len(), 2);
}

#[test]
fn infinite_opacity_is_opaque_and_anything_else_that_is_no_number_is_named() {
    let map = random_map(3);
    let bytes = format_ply(&map);
    let body = bytes.len() - 3 * 17 * 4;
    // Position, normal and colour come before it: nine numbers.
    let with_opacity = |value: f32| {
        let mut bytes = bytes.clone();
        bytes[body + 36..body + 40].copy_from_slice(&value.to_le_bytes());
        bytes
    };
    let opacity = |value: f32| parse(&with_opacity(value)).unwrap().get(0).unwrap().opacity_logit;
    let shown = |logit: f32| 1.0 / (1.0 + (-logit).exp());
    assert_eq!(opacity(1.5), 1.5);
    assert_eq!((shown(opacity(f32::INFINITY)), opacity(f32::NEG_INFINITY)), (1.0, -30.0));
    let message = message(&with_opacity(f32::NAN));
    assert!(message.contains("opacity") && message.contains("map.ply"), "{message}");
}
