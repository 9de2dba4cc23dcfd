//! What a data set does not say about its camera, for judging who finds it out.

use std::path::Path;

use mba_io::dataset::Vignetting;
use mba_io::whole_file::write_text;

use super::description::TRUTH_FOLDER;
use super::{ResponseCurve, SynthError, SynthSequence, description};

/// Writes `calibration.toml`, as it would be on record, exposure times, the response as a curve and a README.
pub(super) fn write(sequence: &SynthSequence, folder: &Path) -> Result<(), SynthError> {
    let config = sequence.config();
    let folder = folder.join(TRUTH_FOLDER);
    let Vignetting { a2, a4 } = config.sensor.vignetting;
    let readme = format!(
        "readout {:?} s, of depth {:?} s; vignetting 1 + {a2:?} r^2 + {a4:?} r^4 (r = 1 in the corner); exposures.csv; response.csv: \
         what is stored (0 to 1) for linear light (0 to 1); calibration.toml: all of it as it would be on record\n",
        config.sensor.readout_seconds, config.sensor.depth_readout_seconds
    );
    // What a program should find lies in a folder that none reads.
    let mut texts = vec![
        ("README.md", readme),
        ("exposures.csv", description::exposures(sequence)),
        ("response.csv", curve(&config.response)),
        ("calibration.toml", description::calibration(sequence)),
    ];
    texts.extend(description::response_table(&config.response));
    for (name, text) in texts {
        write_text(&folder.join(name), &text)?;
    }
    Ok(())
}

/// Values of the response at 256 lights.
fn curve(response: &ResponseCurve) -> String {
    let row = |step: u8| {
        let light = f32::from(step) / 255.0;
        format!("{light:.6},{:.6}\n", response.value(light))
    };
    let rows: String = (0..=u8::MAX).map(row).collect();
    format!("light,value\n{rows}")
}
