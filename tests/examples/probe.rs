use mba_tests::handheld::*;
use mba_tests::plane_scene::PlaneScene;
fn main() {
    let args: Vec<f64> = std::env::args().skip(1).map(|a| a.parse().unwrap()).collect();
    let w = args[0] as usize;
    let shake = Shake { metres: args[1], radians: args[2], hertz: args[3] };
    let frames =
        sequence(&PlaneScene::corner(args[4] as u64, args[5]), &camera_of_width(w), &shake, args[6] as usize);
    for (depth, seed) in [(true, 0), (false, 0)] {
        let _ = seed;
        let mut config = tracker_config(camera_of_width(w));
        config.align.depth_term = depth;
        println!("levels {} surface {}", config.levels, config.surface_level);
        for (r, f) in track_anew(&config, &frames).iter().zip(&frames) {
            let e = pose_error(r, f, &frames[0]);
            println!(
                "{:2} {:?} kf {} err {:.5} m {:.5} rad, blur {:.2}, res {:.3} inl {:.2} dres {:.5} it {} views {} {:?} gain {:.3} {:.4}",
                r.index,
                r.status,
                r.is_keyframe,
                e.0,
                e.1,
                r.blur,
                r.residual,
                r.inliers,
                r.depth_residual,
                r.iterations,
                r.virtual_views,
                r.stop,
                r.brightness.gain,
                r.brightness.offset
            );
        }
    }
    if args.len() > 7 {
        let light: Vec<f32> = frames[0].grey.iter().map(|b| *b as f32).collect();
        let img = image::GrayImage::from_raw(
            w as u32,
            (w * 3 / 4) as u32,
            light.iter().map(|x| *x as u8).collect(),
        )
        .unwrap();
        img.save("/tmp/tests_frame.png").unwrap();
    }
}
