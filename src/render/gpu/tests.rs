//! Devices that fail: each failure ends one job with a sentence, and the next job
//! is none the worse for it.

mod translation;

use super::{Checks, GBufferBy, Gpu, Options, Persistent, device::Setup};
use crate::{
    render::{
        Estimator, Geometry, Job, RenderError, Renderer,
        composite::{Lighting, sun},
        cpu::Cpu,
        materials::Materials,
    },
    scenes::{Scene, Sky, Texture, View, Wrap, library},
    suite::EstimatorFile,
};
use glam::Vec3;
use std::{
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
    time::Duration,
};

/// Loses devices: at these calls of `guarded`, counted over all devices of one
/// setup.
#[derive(Debug)]
pub(crate) struct Fuse {
    calls: AtomicU32,
    at: Vec<u32>,
}

impl Fuse {
    pub(super) fn burns(&self) -> bool {
        self.at.contains(&(self.calls.fetch_add(1, Ordering::Relaxed) + 1))
    }
}

/// A GPU whose devices are lost at these calls.
pub(crate) fn losing(at: impl IntoIterator<Item = u32>) -> Gpu {
    let fuse = Fuse { calls: AtomicU32::new(0), at: at.into_iter().collect() };
    Gpu::set_up(Setup { fuse: Some(Arc::new(fuse)), ..Setup::default() }).unwrap()
}

/// A GPU whose shaders hold a mistake: some text replaced, which must be there.
pub(crate) fn mistaken(from: &'static str, to: &'static str) -> Gpu {
    assert!(super::SHADER.contains(from), "{from}");
    Gpu::set_up(Setup { mistake: Some([from, to]), ..Setup::default() }).unwrap()
}

fn job<'a>(scene: &Scene, view: &'a View, estimator: Estimator) -> Job<'a> {
    Job { view, camera: None, estimator, ao: scene.ao, rays: 4, seed: 1, replicate: 0 }
}

#[test]
fn after_a_loss_the_scene_is_loaded_on_a_new_device() {
    let scene = library::scene("curtain-open").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = scene.measure.view();
    let job = job(&scene, &view, Estimator::CLASSIC);
    let expected = Cpu.load(&geometry).unwrap().render(&job).unwrap().values;
    let differ = |values: &[f32]| values.iter().zip(&expected).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
    // Loading, buffers, two kernels, the dispatch: each may be what is under way.
    for at in 1..6 {
        let gpu = Persistent::new(Ok(losing([at])));
        let mut loaded = gpu.load(&geometry).unwrap();
        let message = loaded.render(&job).unwrap_err().to_string();
        assert!(message.contains("the device was lost"), "{at}: {message}");
        let frame = loaded.render(&job).unwrap();
        assert!(differ(&frame.values) <= 2, "{at}: {}", differ(&frame.values));
        // Another scene begins where the last one ended.
        assert!(gpu.load(&geometry).unwrap().render(&job).is_ok());
    }
}

#[test]
fn a_driver_that_goes_on_losing_devices_is_given_up() {
    let scene = library::scene("plane").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = scene.measure.view();
    let job = job(&scene, &view, Estimator::CLASSIC);
    let gpu = Persistent::new(Ok(losing(1..100)));
    let mut loaded = gpu.load(&geometry).unwrap();
    for _ in 0..4 {
        let message = loaded.render(&job).unwrap_err().to_string();
        assert!(message.contains("the device was lost"), "{message}");
    }
    for _ in 0..2 {
        let message = loaded.render(&job).unwrap_err().to_string();
        assert!(message.contains("4 devices were lost"), "{message}");
    }
}

#[test]
fn a_device_that_hangs_is_given_up() {
    let scene = library::scene("curtain-open").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = scene.measure.view();
    let job = Job { rays: 512, ..job(&scene, &view, Estimator::CLASSIC) };
    let gpu = Gpu::set_up(Setup { patience: Duration::ZERO, ..Setup::default() }).unwrap();
    let mut loaded = gpu.load(&geometry).unwrap();
    // A machine that is busy elsewhere may be done before it is asked.
    let message = (0..50).find_map(|_| loaded.render(&job).err()).unwrap().to_string();
    assert!(message.contains("did not finish within 0 s"), "{message}");
    assert!(gpu.is_lost());
    assert!(loaded.render(&job).unwrap_err().to_string().contains("did not finish"));
}

/// What panics within a driver's call is the device's failure.
#[test]
fn a_panic_of_the_driver_ends_one_job() {
    let gpu = Gpu::open().unwrap();
    let lost = gpu.device.guarded::<()>(|| panic!("Error in Device::poll:\n  Parent device is lost"));
    let message = lost.unwrap_err().to_string();
    assert!(message.contains("Error in Device::poll: Parent device is lost"), "{message}");
    assert!(gpu.is_lost());
}

#[test]
fn refused_buffers_are_errors() {
    let gpu = Gpu::open().unwrap();
    let device = &gpu.device;
    // More than the device's own limit, past our check of it.
    let size = device.device.limits().max_buffer_size + 4;
    let descriptor = wgpu::BufferDescriptor {
        label: Some("huge"),
        size,
        usage: wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    };
    let message = device.guarded(|| Ok(device.device.create_buffer(&descriptor))).unwrap_err().to_string();
    assert!(message.contains("huge") && !message.contains('\n'), "{message}");
    assert!(!gpu.is_lost());
    let buffer = device.guarded(|| device.upload("numbers", &[1, 2, 3, 4])).unwrap();
    assert_eq!(buffer.size(), 4);
}

#[test]
fn what_exceeds_a_binding_is_named() {
    let gpu = Gpu::set_up(Setup { largest_binding: 1 << 16, ..Setup::default() }).unwrap();
    let too_large = |e: RenderError| match e {
        RenderError::TooLarge { what, needs, limit } => {
            assert!(needs > limit && limit == 1 << 16, "{what}: {needs} {limit}");
            what
        }
        other => panic!("{other}"),
    };
    let large = library::scene("atrium").unwrap();
    let geometry = Geometry::new(&large).unwrap();
    assert!(["nodes", "triangles"].contains(&too_large(gpu.load(&geometry).err().unwrap())));

    let mut scene = library::scene("plane").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let mut loaded = gpu.load(&geometry).unwrap();
    let view = View { resolution: [256, 256], ..scene.measure.view() };
    assert_eq!(too_large(loaded.render(&job(&scene, &view, Estimator::CLASSIC)).unwrap_err()), "surfaces");
    let view = View { resolution: [16, 16], ..view };
    assert!(loaded.render(&job(&scene, &view, Estimator::CLASSIC)).is_ok(), "a smaller view on the same device");

    let texels = vec![[9; 4]; 129 * 128];
    scene.objects[0].material.texture = Some(Arc::new(Texture { size: [129, 128], wrap: [Wrap::Clamp; 2], texels }));
    let light = Lighting { lights: vec![], ambient: Vec3::ONE, sky: Sky::None };
    assert_eq!(too_large(gpu.lit(&geometry, &Materials::new(&scene), &light).err().unwrap()), "textures");
}

/// All kernels but ray query's with wgpu's debugging flags, and the Vulkan
/// validation layer where it is installed: no error, caught or not, and the same
/// images with and without checks at run time.
#[test]
fn no_kernel_has_validation_errors() {
    let flags = wgpu::InstanceFlags::VALIDATION | wgpu::InstanceFlags::DEBUG;
    let scene = library::scene("pillar").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = View { resolution: [37, 29], ..scene.look.view() };
    let method = |text: &str| toml::from_str::<EstimatorFile>(text).unwrap().build().unwrap().0;
    let estimators = [
        "kind = 'classic'",
        "kind = 'local-indirect'",
        "kind = 'extended'\nreceiver_plane = 'clipped'\ntemporal = { frames = 2, motion = [9, -7] }\ndenoise = {}",
        "kind = 'hbao'",
        "kind = 'gtao'",
        "kind = 'gtao'\nthickness = 0.02",
        "kind = 'classic'",
    ]
    .map(method);
    let lighting = Lighting { lights: vec![sun(97.0, 58.0, Vec3::ONE)], ambient: Vec3::ONE, sky: Sky::Uniform(1.0) };
    for g_buffer in [GBufferBy::Rays, GBufferBy::Raster] {
        let images = [Checks::On, Checks::Off].map(|checks| {
            let options = Options { checks, g_buffer, ..Options::default() };
            let gpu = Gpu::set_up(Setup { options, flags, ..Setup::default() }).unwrap();
            let mut loaded = gpu.load(&geometry).unwrap();
            let values = estimators.map(|estimator| loaded.render(&job(&scene, &view, estimator)).unwrap().values);
            let shaded = gpu.lit(&geometry, &Materials::new(&scene), &lighting).unwrap().shade(&view).unwrap();
            gpu.device.guarded(|| Ok(())).unwrap();
            assert!(shaded.len() == 37 * 29 && shaded.iter().any(|s| s.direct != Vec3::ZERO));
            let lit: Vec<_> = shaded.iter().map(|s| (s.direct, s.depth, s.albedo, s.normal)).collect();
            (values.map(|v| v.iter().map(|v| v.to_bits()).collect::<Vec<_>>()), lit)
        });
        assert!(images[0] == images[1], "{g_buffer:?}");
    }
}
