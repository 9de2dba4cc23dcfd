//! Pictures side by side, with a slider between before and after.

use super::pictures::{Detail, KeyframePictures};

/// The section of the page; empty without pictures.
pub(super) fn section(pictures: &[KeyframePictures]) -> String {
    if pictures.is_empty() {
        return String::new();
    }
    let figures: String = pictures.iter().map(figure).collect();
    let note = if pictures.iter().any(|p| p.captured.is_some()) {
        "Move the line: captured on its left, deblurred on its right."
    } else {
        "The data set with the captured images was not at hand."
    };
    format!(
        "<h2>Keyframes, before and after</h2>\n<p class=\"note\">The most blurred keyframes along the run, as \
         captured and deblurred. {note}</p>\n<section class=\"keyframes\">\n{figures}</section>\n"
    )
}

fn figure(pictures: &KeyframePictures) -> String {
    let deblurred = picture("deblurred", pictures, &pictures.deblurred);
    let first = match &pictures.captured {
        Some(captured) => slider(pictures, &deblurred, captured),
        None => format!("<div class=\"pane\">{deblurred}<span class=\"right\">deblurred</span></div>"),
    };
    let truth = pictures.truth.as_ref().map_or_else(String::new, |truth| {
        let image = picture("truth", pictures, truth);
        format!("\n<div class=\"pane\">{image}<span class=\"right\">truth</span></div>")
    });
    format!(
        "<figure><div class=\"panes\">\n{first}{truth}\n</div><figcaption>{}</figcaption>{}</figure>\n",
        caption(pictures),
        pictures.detail.as_ref().map_or_else(String::new, |part| detail(pictures, part))
    )
}

/// The captured picture above the deblurred one, cut off where the invisible range input stands.
fn slider(pictures: &KeyframePictures, deblurred: &str, captured: &str) -> String {
    let captured = picture("captured", pictures, captured);
    format!(
        "<div class=\"pane slider\">{deblurred}<div class=\"before\">{captured}</div><i></i>\
         <span class=\"left\">captured</span><span class=\"right\">deblurred</span>\n\
         <input type=\"range\" min=\"0\" max=\"100\" step=\"0.1\" value=\"50\" aria-label=\"captured or deblurred, frame {}\" \
         oninput=\"this.parentNode.style.setProperty('--cut', this.value + '%')\"></div>",
        pictures.index
    )
}

/// The same part of all images side by side, each with its likeness to the truth.
fn detail(pictures: &KeyframePictures, detail: &Detail) -> String {
    let index = pictures.index;
    let one = |kind: &str, base64: &str, ratio: Option<f64>| {
        let ratio = ratio.map_or_else(String::new, |db| format!(", {db:.1} dB"));
        format!(
            "<div><img src=\"data:image/jpeg;base64,{base64}\" alt=\"frame {index}, detail, {kind}\">\
             <p>{kind}{ratio}</p></div>\n"
        )
    };
    let [captured, deblurred] = pictures.psnr.map_or([None; 2], |ratios| ratios.map(Some));
    let truth = detail.truth.as_ref().map_or_else(String::new, |truth| one("truth", truth, None));
    format!(
        "\n<div class=\"detail\">\n{}{}{truth}</div>",
        one("captured", &detail.captured, captured),
        one("deblurred", &detail.deblurred, deblurred)
    )
}

fn picture(kind: &str, pictures: &KeyframePictures, base64: &str) -> String {
    let KeyframePictures { index, size: (width, height), .. } = pictures;
    format!(
        "<img src=\"data:image/jpeg;base64,{base64}\" width=\"{width}\" height=\"{height}\" \
         alt=\"frame {index}, {kind}\">"
    )
}

fn caption(pictures: &KeyframePictures) -> String {
    let ratios = pictures.psnr.map_or_else(String::new, |[captured, deblurred]| {
        format!(" PSNR against the truth (display values): captured {captured:.1} dB, deblurred {deblurred:.1} dB.")
    });
    format!("Frame {}, estimated blur {:.1} px.{ratios}", pictures.index, pictures.blur_px)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pictures() -> KeyframePictures {
        KeyframePictures {
            index: 7,
            blur_px: 6.25,
            size: (640, 480),
            deblurred: "ZA==".into(),
            captured: Some("Yw==".into()),
            truth: Some("dA==".into()),
            psnr: Some([23.26, 25.04]),
            detail: Some(Detail {
                captured: "Yw==".into(),
                deblurred: "ZA==".into(),
                truth: Some("dA==".into()),
            }),
        }
    }

    #[test]
    fn with_truth_there_are_three_pictures_three_details_and_the_figures() {
        let html = section(&[pictures()]);
        assert_eq!((html.matches("<img").count(), html.matches("type=\"range\"").count()), (6, 1));
        for beneath in ["<p>captured, 23.3 dB</p>", "<p>deblurred, 25.0 dB</p>", "<p>truth</p>"] {
            assert!(html.contains(beneath), "{html}");
        }
        assert!(html.contains("captured 23.3 dB, deblurred 25.0 dB"), "{html}");
    }

    #[test]
    fn without_the_data_set_the_deblurred_picture_is_left() {
        let html = section(&[KeyframePictures {
            captured: None,
            truth: None,
            psnr: None,
            detail: None,
            ..pictures()
        }]);
        assert!(html.contains("base64,ZA==") && !html.contains("range") && !html.contains("dB"), "{html}");
    }

    #[test]
    fn without_pictures_there_is_no_section() {
        assert_eq!(section(&[]), "");
    }
}
