//! The RUN folder of a merged job.

use std::time::Instant;

use mba_io::dataset::Dataset;
use mba_io::output::OutputFolder;
use mba_raster::gaussians::Gaussians;
use mba_slam::mapping::{peak_memory_bytes, picture_figures};
use mba_slam::run::{FrameRecord, MapFigures, Merit, Run, RunSettings, RunWriter, Summary};
use mba_tracker::geometry::RigidTransform;

use crate::submap::Submap;
use crate::{Job, SubmapError};

/// What the files of a merged run are made of.
pub(crate) struct MergedRun<'a> {
    pub(crate) job: &'a Job,
    pub(crate) dataset: &'a Dataset,
    pub(crate) run: &'a Run,
    pub(crate) submaps: &'a [Option<Submap>],
    /// `world_from_group_world` by group.
    pub(crate) moves: &'a [RigidTransform],
    /// Logarithm of the factor on the light of every group.
    pub(crate) factors: &'a [f64],
}

impl MergedRun<'_> {
    /// Writes all of it.
    pub(crate) fn write(
        &self,
        map: &Gaussians,
        out: OutputFolder,
        describe: RunSettings,
        started: Instant,
    ) -> Result<Summary, SubmapError> {
        let mut writer = RunWriter::create(out, describe)?;
        let mut figures = MapFigures { gaussians: map.len(), ..MapFigures::default() };
        for k in 0..self.submaps.len() {
            self.push_group(k, &mut writer, &mut figures)?;
        }
        // All poses are known: an earlier run may go before large files are written.
        writer.replace_earlier()?;
        writer.write_map(map)?;
        let keyframes: Vec<usize> = writer.record().keyframes().into_iter().map(|(index, _)| index).collect();
        for &index in &keyframes {
            writer.copy_images(&self.job.group_folder(self.job.plan.owner(index)), index)?;
        }
        let exposures = writer.record().exposures().to_vec();
        let pictures = picture_figures(self.dataset, map, &keyframes, writer.folder(), &exposures);
        let figures = MapFigures {
            gaussians: figures.gaussians,
            iterations: figures.iterations,
            loss: figures.loss,
            keyframes: keyframes.len(),
            map_file_bytes: writer.map_bytes(),
            seconds: figures.seconds + started.elapsed().as_secs_f64(),
            peak_memory_bytes: peak_memory_bytes().max(figures.peak_memory_bytes),
            ..pictures
        };
        let merit = Merit::of(&exposures, self.dataset);
        Ok(writer.finish(|summary| {
            summary.trajectory = merit.trajectory;
            summary.blur = merit.blur;
            summary.map = Some(figures);
        })?)
    }

    /// Adds the frames of group `k`, and what its map took.
    fn push_group(
        &self,
        k: usize,
        writer: &mut RunWriter,
        figures: &mut MapFigures,
    ) -> Result<(), SubmapError> {
        // Only frames that the group owns: those on its border come from their owners.
        let frames = self.job.plan.groups[k].frames();
        if self.submaps[k].is_none() {
            writer
                .record_mut()
                .warn(format!("group {k} is not mapped: frames {frames:?} are as they were tracked"));
            for index in frames {
                let record = FrameRecord { keyframe: 0, ..self.run.frames[index] };
                writer.push(self.run.exposures[index], record)?;
            }
            return Ok(());
        }
        let folder = self.job.group_folder(k);
        let group = Run::open(&folder)?;
        if group.exposures.len() != self.job.plan.frames || group.frames.len() != self.job.plan.frames {
            return Err(SubmapError::Damaged { path: folder });
        }
        // The light of the group's map was multiplied by a factor; the gain of a frame takes it back.
        let gain = (-self.factors[k]).exp();
        for index in frames {
            let record = FrameRecord { gain: group.frames[index].gain * gain, ..group.frames[index] };
            writer.push(group.exposures[index].seen_from(&self.moves[k]), record)?;
        }
        if let Some(map) = group.summary.map {
            figures.iterations += map.iterations;
            figures.seconds += map.seconds;
            // Mean over the groups that are mapped.
            figures.loss += map.loss / self.submaps.iter().flatten().count() as f64;
            figures.peak_memory_bytes = figures.peak_memory_bytes.max(map.peak_memory_bytes);
        }
        group
            .summary
            .warnings
            .into_iter()
            .for_each(|warning| writer.record_mut().warn(format!("group {k}: {warning}")));
        Ok(())
    }
}
