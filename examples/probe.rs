#![allow(missing_docs)]
use aogauge::{
    metrics::{judge::*, regions::*},
    render::{gbuffer::GBuffer, path::irradiance, *},
    scenes::library,
};
use std::time::Instant;
fn main() {
    for name in std::env::args().skip(1) {
        let scene = library::scene(&name).unwrap();
        let g = Geometry::new(&scene).unwrap();
        let t = Geometry::new(&scene.twin()).unwrap();
        let gb = GBuffer::new(&g.tracer, &scene.measure.view());
        let start = Instant::now();
        let regions = Regions::new(&scene, &g.tracer, &gb);
        let rt = start.elapsed();
        let start = Instant::now();
        let pairs: Vec<Pair> = (0..16)
            .map(|r| Pair { with: irradiance(&g, &gb, 8, 1, r), without: irradiance(&t, &gb, 8, 1, r) })
            .collect();
        let el = start.elapsed();
        let j = Judge::new(&pairs, &regions).unwrap();
        let masked = (0..j.q.len()).filter(|&i| j.masked(i)).count();
        println!(
            "{name} regions {rt:?} judge {el:?} widest {:.4} K(Q) {:?} q {:?} masked {}/{}",
            j.widest(),
            j.contrast(),
            [Region::Footprint, Region::Left, Region::Right].map(|r| j.q_of(r).unwrap().value),
            masked,
            j.q.len()
        );
        println!("  E_with {:?}", j.means[0]);
        let start = Instant::now();
        let cpu = cpu::Cpu;
        let mut l = cpu.load(&g).unwrap();
        for est in [
            Estimator::Classic,
            Estimator::Extended { receiver_plane: ReceiverPlane::Counts },
            Estimator::Extended { receiver_plane: ReceiverPlane::Clipped },
        ] {
            let s = Instant::now();
            let f = l
                .render(&Job {
                    view: &scene.measure.view(),
                    estimator: est,
                    ao: scene.ao,
                    rays: 128,
                    seed: 1,
                    replicate: 0,
                })
                .unwrap();
            let m: Vec<f64> = Region::ALL.iter().map(|&r| regions.mean(r, &f.values).unwrap_or(f64::NAN)).collect();
            println!(
                "  {est:?} {m:?} {:?} {:.1} Mprimary/s",
                s.elapsed(),
                f.values.len() as f64 * 128.0 / s.elapsed().as_secs_f64() / 1e6
            );
        }
        let _ = start;
    }
}
