//! Recordings of other programs: whatever they hold, bringing them in ends with a data set or with an error.

use std::cell::RefCell;
use std::fs;

use mba_mapper::dataset::open;
use mba_mapper::import::{ImportOptions, Source, import};

use super::place::{Kept, in_place};

/// Bytes that an archive begins with.
const ARCHIVE: &[u8] = b"PK";

/// A bag, an MCAP file, a `.sens` file or an archive of Record3D.
pub fn recording(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    in_place(
        &KEPT,
        |_| (),
        |place| {
            // Bags and MCAP files are told by their first bytes, whatever their name.
            let name = if data.starts_with(ARCHIVE) { "source.r3d" } else { "source.sens" };
            let (path, out) = (place.write(name, data), place.path("data"));
            let _ = fs::remove_dir_all(&out);
            let Ok(source) = Source::recognise(&path) else { return };
            match import(&source, &out, &ImportOptions::default(), &|_, _| ()) {
                Ok(imported) => {
                    assert!(imported.colour_images > 0 && imported.depth_images > 0);
                    assert!(open(&out).is_ok());
                }
                Err(error) => {
                    assert!(!error.to_string().is_empty());
                    assert!(!out.exists(), "what was written goes again");
                }
            }
        },
    );
}
