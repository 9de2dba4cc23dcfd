//! The viewer of a map inside a page: WebGL2, without network.
//!
//! Its scripts are one closure in the page, in the order in which they build on each other; the page also holds the map
//! ([`pack`]) and what the scripts need to know of the run ([`scene`]).

mod pack;
mod scene;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use mba_mapper::dataset::Dataset;
use mba_mapper::gaussians::Gaussians;
use mba_mapper::run::{Run, RunCamera};

pub(super) use scene::Extent;

use super::html::{TITLE_END, data_set_name, escape};

const STYLE: &str = include_str!("viewer.css");

const ELEMENTS: &str = include_str!("viewer.html");

/// Each uses those before it.
const SCRIPTS: [&str; 9] = [
    include_str!("motion.js"),
    include_str!("painter.js"),
    include_str!("projector.js"),
    include_str!("splats.js"),
    include_str!("unpack.js"),
    include_str!("overlay.js"),
    include_str!("eye.js"),
    include_str!("controls.js"),
    include_str!("main.js"),
];

/// A page that is nothing but the viewer.
const WHOLE: Extent = Extent { keyframes: 48, columns: 480 };

/// The viewer of `map` as a section of a page.
///
/// # Errors
/// When a picture cannot be encoded.
pub(super) fn section(
    run: &Run,
    (map, camera): (&Gaussians, &RunCamera),
    dataset: Option<&Dataset>,
    extent: Extent,
) -> anyhow::Result<String> {
    let scene = serde_json::to_string(&scene::Scene::new(run, (map, camera), dataset, extent)?)?;
    Ok(format!(
        "<style>\n{STYLE}</style>\n{ELEMENTS}<script type=\"application/json\" class=\"scene\">{}</script>\n\
         <script type=\"text/plain\" class=\"gaussians\">{}</script>\n</section>\n\
         <script>\n(() => {{\n'use strict';\n{}}})();\n</script>\n",
        // Nothing in it ends the script.
        scene.replace('<', "\\u003c"),
        STANDARD.encode(pack::pack(map)),
        SCRIPTS.concat(),
    ))
}

/// A page of its own.
///
/// # Errors
/// When a picture cannot be encoded.
pub(super) fn page(
    run: &Run,
    map: (&Gaussians, &RunCamera),
    dataset: Option<&Dataset>,
) -> anyhow::Result<String> {
    let (title, style) = (escape(&data_set_name(&run.summary)), super::html::STYLE);
    let section = section(run, map, dataset, WHOLE)?;
    Ok(format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}{TITLE_END}\n\
         <style>\n{style}</style>\n</head>\n<body class=\"whole\">\n{section}</body>\n</html>\n"
    ))
}
