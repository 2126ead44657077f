//! A pour over time as MCAP, in Foxglove's own schemas: Foxglove opens the file as it is.
//!
//! | topic | schema | what |
//! |---|---|---|
//! | `/grains` | foxglove.PointCloud | centres and radii, f32 `[m]`, frame `world`; of convex bodies also their turn, the quaternion qx, qy, qz, qw from the body's axes (docs/scenes.md, "Shape of the grains") |
//! | `/walls` | foxglove.SceneUpdate | ground, funnel and walls, once, or in every frame where one moves |
//! | `/depth` | foxglove.RawImage, 32FC1 | what the scene's camera delivers `[m]`, frame `camera`; 0 is no data |
//! | `/heights` | foxglove.RawImage, 32FC1 | the same for an orthographic camera, instead of `/depth` |
//! | `/camera` | foxglove.CameraCalibration | the pinhole camera of `/depth` |
//! | `/views/NAME/depth`, `/views/NAME/camera` | as `/depth` and `/camera` | the same of each of the scene's further views, frame `views/NAME` |
//! | `/tf` | foxglove.FrameTransform | where the frames `camera` and `views/NAME` are in `world` |
//!
//! Time 0 is the start of the pour. The scene's TOML, the seed and the outcome stand in the metadata
//! record `granulcal`, the TOML also as the attachment `scene.toml`.

mod stamp;
mod walls;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use foxglove::Encode;
use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{
    CameraCalibration, FrameTransform, PackedElementField, PointCloud, Pose, Quaternion, RawImage,
    Vector3,
};
use granulcal_dem::{Pour, Simulation};
use granulcal_features::{Camera, DepthImage, Intrinsics};
use granulcal_scene::Scene;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, McapError, McapResult, WriteOptions, Writer};

use stamp::{WORLD, nanoseconds, timestamp};

use crate::files::PendingFile;
use crate::frame_rate::check_frame_rate;
use crate::{DatasetError, Drawn, Form, Observer, VERSION, View, capture, capture_from};

const CAMERA: &str = "camera";
/// Bytes of one grain in `/grains`: x, y, z, radius.
const STRIDE: u32 = 16;
/// The same of a convex body, with its turn as a quaternion.
const TURNED_STRIDE: u32 = 32;

/// A pour, and whether its film could be kept.
pub type Filmed = (Pour, Result<(), DatasetError>);

/// Runs a simulation of `scene` with `seed` to its end and writes `rate` frames a simulated second, and one
/// at the end.
///
/// `observer` sees what the scene observes.
/// `watch` is called with the simulated time before each frame and returns whether to go on; when it
/// says no the result is `None` and no file is left. A file that fails on the way, on a full disk above all, does not
/// stop the pour: it is returned with what was wrong, and no file is left.
///
/// # Errors
/// [`DatasetError::Argument`] for a scene or a seed that is not the simulation's, or a rate that is not positive or
/// above one frame a substep; [`DatasetError::Io`] or [`DatasetError::Mcap`] if the file cannot be begun.
pub fn record_pour(
    mut simulation: Simulation,
    scene: &Scene,
    seed: u64,
    rate: f64,
    path: &Path,
    observer: &mut Observer,
    watch: &mut dyn FnMut(f64) -> bool,
) -> Result<Option<Filmed>, DatasetError> {
    require_its_own(&simulation, scene, seed)?;
    check_frame_rate(rate, &simulation)?;
    let scene_toml = scene.to_toml().map_err(DatasetError::refused)?;
    let failed = |source| DatasetError::Mcap { path: path.to_owned(), source };
    let mut recorder = Recorder::create(path)?;
    recorder.attach_scene(&scene_toml).map_err(failed)?;
    let mut film = Ok(recorder);
    for frame in 1u64.. {
        if !watch(simulation.time()) {
            return Ok(None);
        }
        film = film.and_then(|recorder| recorder.with_frame(scene, seed, &simulation));
        if simulation.ended().is_some() {
            break;
        }
        // From the frame's own time: rounding to substeps must not add up.
        let seconds = frame as f64 / rate - simulation.time();
        observer.advance(&mut simulation, seconds)?;
    }
    let pour = simulation.into_pour();
    let outcome = [
        ("scene", scene_toml),
        ("seed", seed.to_string()),
        ("version", VERSION.to_owned()),
        ("status", pour.status.name().to_owned()),
        ("simulated_s", pour.simulated_s.to_string()),
    ];
    Ok(Some((pour, film.and_then(|recorder| recorder.finish(&outcome)))))
}

/// Refuses a scene or a seed that is not the simulation's: the film would be of another pour than it says.
fn require_its_own(simulation: &Simulation, scene: &Scene, seed: u64) -> Result<(), DatasetError> {
    let refuse =
        |what, got| Err(DatasetError::Argument { what, got, allowed: "that of the simulation" });
    let difference = simulation.scene().first_difference(scene).map_err(DatasetError::refused)?;
    if let Some((key, own, given)) = difference {
        return refuse("the scene of a film", format!("{key} {given} for {own}"));
    }
    if seed != simulation.seed() {
        return refuse("the seed of a film", format!("{seed} for {}", simulation.seed()));
    }
    Ok(())
}

/// An MCAP file being written, with the sequence number of each topic.
struct Recorder<'a> {
    writer: Writer<PendingFile>,
    path: &'a Path,
    sequences: BTreeMap<u16, u32>,
    has_walls: bool,
}

impl<'a> Recorder<'a> {
    fn create(path: &'a Path) -> Result<Self, DatasetError> {
        let options = WriteOptions::new().library(format!("granulcal {VERSION}")).compression(None);
        let writer = options
            .create(PendingFile::create(path, Form::Mcap)?)
            .map_err(|source| DatasetError::Mcap { path: path.to_owned(), source })?;
        Ok(Self { writer, path, sequences: BTreeMap::new(), has_walls: false })
    }

    fn attach_scene(&mut self, scene_toml: &str) -> McapResult<()> {
        self.writer.attach(&Attachment {
            log_time: 0,
            create_time: 0,
            name: "scene.toml".to_owned(),
            media_type: "application/toml".to_owned(),
            data: Cow::Borrowed(scene_toml.as_bytes()),
        })
    }

    /// Adds everything that there is to see at one time.
    fn with_frame(
        mut self,
        scene: &Scene,
        seed: u64,
        simulation: &Simulation,
    ) -> Result<Self, DatasetError> {
        let time = simulation.time();
        let failed = |source| DatasetError::Mcap { path: self.path.to_owned(), source };
        let (positions, radii) = (simulation.positions(), simulation.radii());
        let convex = simulation.convex();
        let drawn =
            Drawn { positions: &positions, radii: &radii, convex: convex.as_ref(), bed: None };
        let view = capture(&scene.camera, &drawn, seed);
        let further: Vec<_> = scene
            .views
            .iter()
            .map(|view| (format!("views/{}", view.name), capture_from(view, &drawn)))
            .collect();
        let shows_walls = !self.has_walls || walls::move_ever(scene);
        self.has_walls = true;
        let messages = |recorder: &mut Self| -> McapResult<()> {
            if shows_walls {
                recorder.send("/walls", time, &walls::walls(scene, time))?;
            }
            recorder.send("/grains", time, &grains(time, &drawn))?;
            match view {
                Ok(View::Depth(camera, image)) => {
                    recorder.depth_image(time, CAMERA, ["/depth", "/camera"], &camera, &image)?;
                }
                Ok(View::Heights(map)) => {
                    let heights: Vec<_> = map.z.iter().map(|&z| z as f32).collect();
                    let image = raw_image(time, WORLD, map.width, map.height, &heights);
                    recorder.send("/heights", time, &image)?;
                }
                // Grains of an unhealthy pour can be anywhere, NaN included; the cloud shows it.
                Err(_) => return Ok(()),
            }
            for (frame, view) in &further {
                if let Ok(View::Depth(camera, image)) = view {
                    let topics = [&*format!("/{frame}/depth"), &*format!("/{frame}/camera")];
                    recorder.depth_image(time, frame, topics, camera, image)?;
                }
            }
            Ok(())
        };
        messages(&mut self).map_err(failed)?;
        Ok(self)
    }

    /// A depth image on the first topic, its camera on the second and where it stands.
    fn depth_image(
        &mut self,
        time: f64,
        frame: &str,
        [depth, calibrated]: [&str; 2],
        camera: &Camera,
        image: &DepthImage,
    ) -> McapResult<()> {
        self.send("/tf", time, &pose_of(time, frame, camera))?;
        self.send(calibrated, time, &calibration(time, frame, &camera.intrinsics))?;
        self.send(depth, time, &raw_image(time, frame, image.width, image.height, &image.depth))
    }

    fn send<T: Encode>(&mut self, topic: &str, time: f64, message: &T) -> McapResult<()> {
        let mut bytes = Vec::new();
        message
            .encode(&mut bytes)
            .map_err(|e| McapError::Io(std::io::Error::other(e.to_string())))?;
        // The writer gives a schema or channel that it knows the number it has.
        let schema = match T::get_schema() {
            Some(schema) => self.writer.add_schema(&schema.name, &schema.encoding, &schema.data)?,
            None => 0,
        };
        let encoding = T::get_message_encoding();
        let channel_id = self.writer.add_channel(schema, topic, &encoding, &BTreeMap::new())?;
        let sequence = self.sequences.entry(channel_id).or_insert(0);
        let log_time = nanoseconds(time);
        let header =
            MessageHeader { channel_id, sequence: *sequence, log_time, publish_time: log_time };
        *sequence += 1;
        self.writer.write_to_known_channel(&header, &bytes)
    }

    fn finish(mut self, metadata: &[(&str, String)]) -> Result<(), DatasetError> {
        let failed = |source| DatasetError::Mcap { path: self.path.to_owned(), source };
        let metadata = metadata.iter().map(|(key, value)| ((*key).to_owned(), value.clone()));
        self.writer
            .write_metadata(&Metadata {
                name: "granulcal".to_owned(),
                metadata: metadata.collect(),
            })
            .map_err(failed)?;
        self.writer.finish().map_err(failed)?;
        self.writer.into_inner().commit()
    }
}

fn grains(time: f64, drawn: &Drawn<'_>) -> PointCloud {
    let turned = drawn.convex.map(|convex| &convex.orientations);
    let stride = if turned.is_some() { TURNED_STRIDE } else { STRIDE };
    let mut data = Vec::with_capacity(drawn.radii.len() * stride as usize);
    for (grain, (position, radius)) in drawn.positions.iter().zip(drawn.radii).enumerate() {
        let place = [position.x, position.y, position.z, *radius];
        let turn = turned.map(|all| <[f64; 4]>::from(all[grain].coords));
        for value in place.into_iter().chain(turn.into_iter().flatten()) {
            data.extend((value as f32).to_le_bytes());
        }
    }
    let names = ["x", "y", "z", "radius", "qx", "qy", "qz", "qw"];
    let names = &names[..stride as usize / 4];
    let field = |(index, name): (u32, &str)| PackedElementField {
        name: name.to_owned(),
        offset: 4 * index,
        r#type: NumericType::Float32.into(),
    };
    PointCloud {
        timestamp: timestamp(time),
        frame_id: WORLD.to_owned(),
        pose: Some(Pose {
            position: Some(Vector3::default()),
            orientation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }),
        }),
        point_stride: stride,
        fields: (0..).zip(names).map(|(index, name)| field((index, *name))).collect(),
        data: data.into(),
    }
}

fn raw_image(time: f64, frame: &str, width: usize, height: usize, values: &[f32]) -> RawImage {
    RawImage {
        timestamp: timestamp(time),
        frame_id: frame.to_owned(),
        width: width as u32,
        height: height as u32,
        encoding: "32FC1".to_owned(),
        step: 4 * width as u32,
        data: values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>().into(),
    }
}

fn calibration(time: f64, frame: &str, lens: &Intrinsics) -> CameraCalibration {
    // Foxglove follows OpenCV: the centre of the first pixel is (0, 0).
    let (cx, cy) = (lens.cx - 0.5, lens.cy - 0.5);
    let (fx, fy) = (lens.fx, lens.fy);
    CameraCalibration {
        timestamp: timestamp(time),
        frame_id: frame.to_owned(),
        width: lens.width as u32,
        height: lens.height as u32,
        distortion_model: String::new(),
        d: Vec::new(),
        k: vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: vec![fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
}

fn pose_of(time: f64, frame: &str, camera: &Camera) -> FrameTransform {
    let world_from_camera = camera.camera_from_world.inverse();
    let (at, turn) = (world_from_camera.translation.vector, world_from_camera.rotation);
    FrameTransform {
        timestamp: timestamp(time),
        parent_frame_id: WORLD.to_owned(),
        child_frame_id: frame.to_owned(),
        translation: Some(Vector3 { x: at.x, y: at.y, z: at.z }),
        rotation: Some(Quaternion { x: turn.i, y: turn.j, z: turn.k, w: turn.w }),
    }
}
