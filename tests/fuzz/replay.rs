//! Everything that fuzzing ever failed on, and its seeds, once more and without a fuzzer.

// In the package of its own these functions are public.
#[allow(unreachable_pub, reason = "the same sources are a library elsewhere")]
#[path = "src/lib.rs"]
mod targets;

use std::fs;
use std::path::Path;

use targets::TARGETS;

#[test]
fn seeds_and_found_faults_are_read_or_refused() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz");
    for (name, target) in TARGETS {
        let mut inputs = 0;
        for kind in ["seeds", "found"] {
            let Ok(files) = fs::read_dir(root.join(kind).join(name)) else { continue };
            for file in files {
                let path = file.unwrap().path();
                // A test that fails says which input it was.
                println!("{}", path.display());
                target(&fs::read(path).unwrap());
                inputs += 1;
            }
        }
        assert!(inputs > 0, "{name} has no seeds");
        target(&[]);
        target(&[0]);
    }
}

#[test]
fn the_seeds_reach_what_they_are_for() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds");
    let read = |name: &str| fs::read(root.join(name)).unwrap();
    let path = Path::new("file.ply");
    assert_eq!(mba_mapper::gaussians::parse_ply(path, &read("gaussians/six")).unwrap().len(), 6);
    assert_eq!(mba_mapper::mesh::parse_mesh(path, &read("mesh/square")).unwrap().triangles.len(), 2);
    assert!(mba_mapper::dataset::read_calibration(&root.join("calibration/everything")).is_ok());
    assert_eq!(
        mba_mapper::dataset::read_exposure_times(&root.join("exposure_times/table")).unwrap().0.len(),
        4
    );
    for response in ["response/codes", "response/rows"] {
        assert!(mba_mapper::dataset::read_response(&root.join(response)).is_ok(), "{response}");
    }
    for image in fs::read_dir(root.join("image_of_any_size")).unwrap() {
        let path = image.unwrap().path();
        assert!(mba_mapper::dataset::read_image(&path).is_ok(), "{}", path.display());
    }
}
