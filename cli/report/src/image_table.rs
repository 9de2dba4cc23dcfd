//! Tables of compared images.

use std::fmt::Write as _;

use mba_mapper::image_folders::{ColourMean, FolderFigures, ImageFigures};

use super::table::{pairs, percent};

/// The table of two folders: a line per image, means, and how many images have no partner.
#[must_use]
pub fn folders(figures: &FolderFigures) -> String {
    let mut text = String::new();
    if let Some(mean) = &figures.mean {
        text += &colour(figures, mean);
    }
    if !figures.depth.is_empty() {
        text += &depth(figures);
    }
    text + &pairs(&[
        ("only in the reference", figures.unpaired.reference.to_string()),
        ("only in the estimate", figures.unpaired.estimate.to_string()),
    ])
}

/// Lines of colour images.
fn colour(figures: &FolderFigures, mean: &ColourMean) -> String {
    let mut text = format!("{:24}{:>12}{:>12}", "", "PSNR [dB]", "SSIM");
    if mean.captured.is_some() {
        let _ = write!(text, "{:>16}{:>12}{:>12}", "captured [dB]", "SSIM", "gain [dB]");
    }
    text.push('\n');
    for image in &figures.images {
        text += &colour_row(&image.name, &image.estimate, image.captured.as_ref());
    }
    text + &colour_row("mean", &mean.estimate, mean.captured.as_ref()) + "\n"
}

fn colour_row(name: &str, estimate: &ImageFigures, captured: Option<&ImageFigures>) -> String {
    let ImageFigures { psnr_db, ssim } = estimate;
    // Writing to a string cannot fail.
    let mut text = format!("{name:24}{psnr_db:>12.2}{ssim:>12.4}");
    if let Some(captured) = captured {
        // Both are infinite where both images equal the reference.
        let gain = if *psnr_db == captured.psnr_db { 0.0 } else { psnr_db - captured.psnr_db };
        let _ = write!(text, "{:>16.2}{:>12.4}{gain:>+12.2}", captured.psnr_db, captured.ssim);
    }
    text + "\n"
}

/// Lines of depth maps.
fn depth(figures: &FolderFigures) -> String {
    let mut text = format!("{:24}{:>12}{:>12}\n", "", "L1 [m]", "compared");
    let metres = |l1: Option<f64>| l1.map_or_else(|| "none".to_owned(), |l1| format!("{l1:.4}"));
    for map in &figures.depth {
        let _ = writeln!(text, "{:24}{:>12}{:>12}", map.name, metres(map.l1_m), percent(map.share));
    }
    text + &format!("{:24}{:>12}\n\n", "mean", metres(figures.mean_depth_l1_m))
}

#[cfg(test)]
mod tests {
    use mba_mapper::image_folders::{ColourFigures, DepthFigures, Unpaired};

    use super::*;

    fn image(psnr_db: f64) -> ImageFigures {
        ImageFigures { psnr_db, ssim: psnr_db / 100.0 }
    }

    #[test]
    fn the_gain_is_that_over_the_captured_frame() {
        let (estimate, captured) = (image(30.25), Some(image(27.0)));
        let figures = FolderFigures {
            images: vec![ColourFigures { name: "000012".into(), estimate, captured }],
            mean: Some(ColourMean { estimate, captured }),
            depth: Vec::new(),
            mean_depth_l1_m: None,
            unpaired: Unpaired { reference: 3, estimate: 0 },
        };
        let text = folders(&figures);
        let cells = |row: usize| text.lines().nth(row).unwrap_or_default().split_whitespace();
        assert!(cells(1).eq(["000012", "30.25", "0.3025", "27.00", "0.2700", "+3.25"]), "{text}");
        assert!(cells(2).eq(["mean", "30.25", "0.3025", "27.00", "0.2700", "+3.25"]), "{text}");
        assert!(cells(4).eq(["only", "in", "the", "reference", "3"]), "{text}");
    }

    #[test]
    fn maps_without_a_common_pixel_have_no_difference() {
        let map = |name: &str, l1_m, share| DepthFigures { name: name.into(), l1_m, share };
        let figures = FolderFigures {
            images: Vec::new(),
            mean: None,
            depth: vec![map("a", Some(0.0123), 0.5), map("b", None, 0.0)],
            mean_depth_l1_m: Some(0.0123),
            unpaired: Unpaired { reference: 0, estimate: 1 },
        };
        let text = folders(&figures);
        let cells = |row: usize| text.lines().nth(row).unwrap_or_default().split_whitespace();
        assert!(
            cells(1).eq(["a", "0.0123", "50.0", "%"]) && cells(2).eq(["b", "none", "0.0", "%"]),
            "{text}"
        );
        assert!(cells(3).eq(["mean", "0.0123"]), "{text}");
    }
}
