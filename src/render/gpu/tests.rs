//! Devices that fail: each failure ends one job with a sentence, and the next job
//! is none the worse for it.

use super::{Checks, Gpu, Options, Persistent, device::Setup};
use crate::{
    render::{
        Estimator, Falloff, Geometry, Job, LocalIndirect, RenderError, Renderer, Scale,
        composite::{Lighting, sun},
        cpu::Cpu,
        materials::Materials,
    },
    scenes::{Scene, Sky, Texture, View, Wrap, library},
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
        let gpu = Persistent::new(losing([at]));
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
    let gpu = Persistent::new(losing(1..100));
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

/// All kernels with wgpu's debugging flags, and the Vulkan validation layer where
/// it is installed: no error, caught or not. Lit views are the same with and
/// without checks at run time.
#[test]
fn no_kernel_has_validation_errors() {
    let flags = wgpu::InstanceFlags::VALIDATION | wgpu::InstanceFlags::DEBUG;
    let scene = library::scene("pillar").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = View { resolution: [37, 29], ..scene.look.view() };
    let indirect = Estimator::LocalIndirect(LocalIndirect { falloff: Falloff::Step, scale: Scale::default() });
    let lighting = Lighting { lights: vec![sun(97.0, 58.0, Vec3::ONE)], ambient: Vec3::ONE, sky: Sky::Uniform(1.0) };
    let lit = [Checks::On, Checks::Off].map(|checks| {
        let gpu = Gpu::set_up(Setup { options: Options { checks, ..Options::default() }, flags, ..Setup::default() })
            .unwrap();
        let mut loaded = gpu.load(&geometry).unwrap();
        for estimator in [Estimator::CLASSIC, indirect, Estimator::CLASSIC] {
            loaded.render(&job(&scene, &view, estimator)).unwrap();
        }
        let shaded = gpu.lit(&geometry, &Materials::new(&scene), &lighting).unwrap().shade(&view).unwrap();
        gpu.device.guarded(|| Ok(())).unwrap();
        shaded.iter().map(|s| (s.direct, s.depth, s.albedo, s.normal)).collect::<Vec<_>>()
    });
    assert!(lit[0].len() == 37 * 29 && lit[0].iter().any(|s| s.0 != Vec3::ZERO));
    assert_eq!(lit[0], lit[1]);
}
