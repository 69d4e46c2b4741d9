//! Embree 3.13 through `benches/embree.cpp`, on the same triangles and rays.

use crate::trace::Packet;
use glam::Vec3;
use std::ffi::c_void;

unsafe extern "C" {
    fn em_new(corners: *const f32, triangles: u32, robust: i32) -> *mut c_void;
    fn em_free(s: *mut c_void);
    fn em_occluded1(s: *mut c_void, points: *const f32, n: u64, k: u32, dirs: *const f32, tmax: f32, out: *mut u8);
    fn em_occluded8(s: *mut c_void, points: *const f32, n: u64, k: u32, dirs: *const f32, tmax: f32, out: *mut u8);
    fn em_occluded1m(
        s: *mut c_void,
        points: *const f32,
        n: u64,
        k: u32,
        dirs: *const f32,
        tmax: f32,
        out: *mut u8,
        batch: u32,
    );
    fn em_intersect1(s: *mut c_void, org: *const f32, dir: *const f32, n: u64, t: *mut f32);
    fn em_occluded_free1(s: *mut c_void, org: *const f32, dir: *const f32, tmax: *const f32, n: u64, out: *mut u8);
    fn em_occluded_free(s: *mut c_void, org: *const f32, dir: *const f32, tmax: *const f32, n: u64, out: *mut u8);
    fn em_occluded_free1m(
        s: *mut c_void,
        org: *const f32,
        dir: *const f32,
        tmax: *const f32,
        n: u64,
        out: *mut u8,
        batch: u32,
    );
}

/// Which of Embree's calls.
#[derive(Clone, Copy, Debug)]
pub enum Call {
    /// `rtcOccluded1`.
    One,
    /// `rtcOccluded8`.
    Eight,
    /// `rtcOccluded1M` with so many rays, a multiple of eight.
    Stream(u32),
}

impl Call {
    /// All that are raced.
    pub const ALL: [Call; 5] = [Call::One, Call::Eight, Call::Stream(64), Call::Stream(256), Call::Stream(1024)];

    /// As in tables.
    pub fn name(self) -> String {
        match self {
            Call::One => "Embree 1".into(),
            Call::Eight => "Embree 8".into(),
            Call::Stream(n) => format!("Embree 1M, {n}"),
        }
    }
}

/// A committed scene.
pub struct Embree(*mut c_void);

// SAFETY: a committed scene is only read by ray queries, which Embree allows from any
// number of threads. Tested by `it_meets_what_we_meet`, on two.
unsafe impl Sync for Embree {}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: `em_new` made it, and nothing else frees it.
        unsafe { em_free(self.0) }
    }
}

impl Embree {
    /// Builds the highest quality tree.
    pub fn new(triangles: &[[Vec3; 3]], robust: bool) -> Self {
        // SAFETY: a `Vec3` is three floats, so a triangle is nine in a row; they are copied.
        Embree(unsafe { em_new(triangles.as_ptr().cast(), triangles.len() as u32, i32::from(robust)) })
    }

    /// Rays that leave points together, packets point by point: a bit each in `out`.
    pub fn occluded_from(&self, call: Call, points: &[Vec3], packets: &[Packet], tmax: f32, out: &mut [u8]) {
        assert!(packets.len() == out.len() && packets.len().is_multiple_of(points.len()));
        let (p, n, d, o) = (points.as_ptr().cast(), points.len() as u64, packets.as_ptr().cast(), out.as_mut_ptr());
        let k = 8 * (packets.len() / points.len()) as u32;
        // SAFETY: a `Packet` is x[8] y[8] z[8]; the lengths are those asserted.
        unsafe {
            match call {
                Call::One => em_occluded1(self.0, p, n, k, d, tmax, o),
                Call::Eight => em_occluded8(self.0, p, n, k, d, tmax, o),
                Call::Stream(batch) => em_occluded1m(self.0, p, n, k, d, tmax, o, batch),
            }
        }
    }

    /// Rays with origins and lengths of their own, a multiple of eight.
    pub fn occluded(&self, call: Call, origins: &[Vec3], directions: &[Vec3], tmax: &[f32], out: &mut [u8]) {
        assert!(origins.len() == directions.len() && origins.len() == tmax.len() && origins.len() == 8 * out.len());
        let (p, d, n) = (origins.as_ptr().cast(), directions.as_ptr().cast(), origins.len() as u64);
        let (t, o) = (tmax.as_ptr(), out.as_mut_ptr());
        // SAFETY: a `Vec3` is three floats; the lengths are those asserted.
        unsafe {
            match call {
                Call::One => em_occluded_free1(self.0, p, d, t, n, o),
                Call::Eight => em_occluded_free(self.0, p, d, t, n, o),
                Call::Stream(batch) => em_occluded_free1m(self.0, p, d, t, n, o, batch),
            }
        }
    }

    /// Distances of closest hits, infinite without; by `rtcIntersect1`.
    pub fn closest(&self, origins: &[Vec3], directions: &[Vec3], t: &mut [f32]) {
        assert!(origins.len() == directions.len() && origins.len() == t.len());
        let (p, d) = (origins.as_ptr().cast(), directions.as_ptr().cast());
        // SAFETY: a `Vec3` is three floats; the lengths are those asserted.
        unsafe { em_intersect1(self.0, p, d, t.len() as u64, t.as_mut_ptr()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::{Ray, Tracer};

    #[test]
    fn it_meets_what_we_meet() {
        let scene = crate::scenes::library::scene("leaves").unwrap();
        let triangles: Vec<_> = scene.triangles().map(|t| t.1).collect();
        let (tracer, embree) = (Tracer::new(&triangles), Embree::new(&triangles, false));
        let n = 8000;
        let place = |i: u32| {
            let [a, b] = crate::render::sampler::Sampler::new(3, i, 0).pair(0, 0);
            scene.measure.center + Vec3::new(a - 0.5, 0.02, b - 0.5)
        };
        let origins: Vec<Vec3> = (0..n).map(place).collect();
        let towards = |i: u32| (place(i + n) + Vec3::Y * 0.5 - place(i)).normalize();
        let directions: Vec<Vec3> = (0..n).map(towards).collect();
        let lengths = vec![1.0; n as usize];
        let ray = |i: usize| Ray::new(origins[i], directions[i], 1.0);
        let ours: Vec<bool> = (0..n as usize).map(|i| tracer.occluded(&ray(i))).collect();
        assert!(ours.iter().filter(|hit| **hit).count() > 500);
        std::thread::scope(|threads| {
            for call in [Call::One, Call::Eight, Call::Stream(64)] {
                let (embree, origins, directions, lengths, ours) = (&embree, &origins, &directions, &lengths, &ours);
                threads.spawn(move || {
                    let mut out = vec![0u8; origins.len() / 8];
                    embree.occluded(call, origins, directions, lengths, &mut out);
                    let differ = ours.iter().enumerate().filter(|(i, hit)| **hit != (out[i / 8] >> (i % 8) & 1 == 1));
                    assert!(differ.count() <= 2, "{call:?}");
                });
            }
        });
        let mut t = vec![0.0; n as usize];
        embree.closest(&origins, &directions, &mut t);
        let near = (0..n as usize).filter(|&i| {
            let own = tracer.closest(&Ray::new(origins[i], directions[i], 1e30)).map_or(f32::INFINITY, |h| h.t);
            own == t[i] || (own - t[i]).abs() < 1e-4
        });
        assert!(near.count() as u32 + 2 >= n);
    }
}
