//! What image metrics see and what they miss: one picture, distorted in seven ways to
//! the same root mean squared error, that of classic AO, and all scores beside each other.
//!
//! `cargo run --release --example metric_gallery -- docs/metrics` writes the
//! pictures of docs/metrics.md there and prints its table.

use aogauge::{
    layers::write_png,
    metrics::{
        artifact::Brighter,
        image::{Encoding, Image, Maps, Options, Pair, ScoreName, Scores, scores},
        regions::{Region, Regions},
    },
    picture::{
        error_map::{Caption, ErrorMap},
        scale::Scale,
    },
    render::{
        Estimator, Extension, Falloff, Geometry, Job, Openness, ReceiverPlane, Renderer, cpu::Cpu, gbuffer::GBuffer,
        sampler::Sampler,
    },
    scenes::{Scene, View, library},
};
use std::{error::Error, path::Path};

const RAYS: u32 = 1024;
const SCENE: &str = "curtain-arcade";

/// Openness of one view: what it should be, and what classic AO makes of it.
struct Seen {
    width: usize,
    extended: Vec<f32>,
    classic: Vec<f32>,
}

impl Seen {
    fn new(geometry: &Geometry, scene: &Scene, view: &View) -> Result<Self, Box<dyn Error>> {
        let clipped = Some(Extension::of_the_paper(ReceiverPlane::Clipped));
        let classic = Openness::plain(Falloff::Step);
        let cpu = Cpu;
        let mut loaded = cpu.load(geometry)?;
        let mut render = |openness: Openness| {
            let estimator = Estimator::Openness(openness);
            let job = Job { view, camera: None, estimator, ao: scene.ao, rays: RAYS, seed: 1, replicate: 0 };
            loaded.render(&job).map(|frame| frame.values)
        };
        let extended = render(Openness { extension: clipped, ..classic })?;
        Ok(Seen { width: view.resolution[0] as usize, extended, classic: render(classic)? })
    }

    fn size(&self) -> [usize; 2] {
        [self.width, self.extended.len() / self.width]
    }

    /// The image moved to the right by columns and parts of them.
    fn moved(&self, i: usize, columns: f32) -> f32 {
        let whole = columns.floor() as usize;
        let at = |columns: usize| self.extended[i - (i % self.width).min(columns)];
        at(whole) + columns.fract() * (at(whole + 1) - at(whole))
    }

    /// A Gaussian about a pixel, over numbers alone.
    fn blurred(&self, i: usize, deviation: f32) -> f32 {
        let ([width, height], reach) = (self.size(), (3.0 * deviation).ceil() as usize);
        let (x, y) = (i % width, i / width);
        let (mut sum, mut n) = (0.0, 0.0);
        for row in y.saturating_sub(reach)..=(y + reach).min(height - 1) {
            for column in x.saturating_sub(reach)..=(x + reach).min(width - 1) {
                let v = self.extended[row * width + column];
                if v.is_finite() {
                    let distance = (column as f32 - x as f32).powi(2) + (row as f32 - y as f32).powi(2);
                    let weight = (-0.5 * distance / (deviation * deviation).max(1e-6)).exp();
                    (sum, n) = (sum + weight * v, n + weight);
                }
            }
        }
        sum / n
    }
}

/// A way to be wrong: its name, what it stands for, the strongest amount, and a
/// pixel at an amount.
struct Distortion {
    name: &'static str,
    cause: &'static str,
    most: f32,
    at: fn(&Seen, usize, f32) -> f32,
}

const DISTORTIONS: [Distortion; 7] = [
    Distortion { name: "darker", cause: "a wrong constant", most: 0.5, at: |s, i, a| s.extended[i] - a },
    Distortion {
        name: "gamma",
        cause: "a curve applied twice, or never",
        most: 3.0,
        at: |s, i, a| s.extended[i].powf(1.0 + a),
    },
    Distortion {
        name: "noise",
        cause: "too few rays",
        most: 1.0,
        at: |s, i, a| s.extended[i] + a * (uniform(i) - 0.5),
    },
    Distortion {
        name: "outliers",
        cause: "missed hits",
        most: 1.0,
        at: |s, i, a| if uniform(i) < a * 0.2 { 1.0 } else { s.extended[i] },
    },
    Distortion { name: "blur", cause: "a denoiser", most: 8.0, at: Seen::blurred },
    Distortion { name: "shift", cause: "a wrong projection", most: 16.0, at: Seen::moved },
    Distortion { name: "highlight", cause: "classic AO", most: 1.0, at: |s, i, _| s.classic[i] },
];

fn uniform(pixel: usize) -> f32 {
    Sampler::new(3, pixel as u32, 0).pair(0, 0)[0]
}

impl Distortion {
    fn image(&self, seen: &Seen, amount: f32) -> Vec<f32> {
        (0..seen.extended.len()).map(|i| (self.at)(seen, i, amount)).collect()
    }

    /// The amount that makes an error as large as that of classic AO.
    fn amount(&self, seen: &Seen) -> f32 {
        let rmse = |image: &[f32]| {
            let squares = image.iter().zip(&seen.extended).map(|(a, b)| f64::from(a - b).powi(2));
            let squares: Vec<f64> = squares.filter(|d| d.is_finite()).collect();
            (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
        };
        let wanted = rmse(&seen.classic);
        let (mut low, mut high) = (0.0, self.most);
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            if rmse(&self.image(seen, middle)) < wanted { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }
}

fn grey(seen: &Seen, values: &[f32]) -> Result<Image, Box<dyn Error>> {
    Ok(Image::new(seen.size(), vec![values.to_vec()], Encoding::Linear)?)
}

fn picture(seen: &Seen, values: &[f32], path: &Path) -> Result<(), Box<dyn Error>> {
    let [width, height] = seen.size().map(|n| n as u32);
    let shown = image::RgbImage::from_fn(width * 2, height * 2, |x, y| {
        let v = values[(y / 2 * width + x / 2) as usize];
        // The values themselves: openness is near 1 almost everywhere, and the sRGB
        // curve would leave little to see.
        image::Rgb([(v.clamp(0.0, 1.0) * 255.0).round() as u8; 3])
    });
    Ok(write_png(path, &shown)?)
}

fn map(seen: &Seen, values: Vec<f32>, scale: Scale, title: &str, path: &Path) -> Result<(), Box<dyn Error>> {
    let map = ErrorMap::new(seen.size().map(|n| n as u32), values, scale)?;
    Ok(write_png(path, &map.picture(&Caption { title, unit: "openness" }))?)
}

/// Highlight contrast of an image of the measure view against its own brighter
/// flank, less that of the reference.
fn contrast_error(regions: &Regions, seen: &Seen, image: &[f32]) -> Result<f64, Box<dyn Error>> {
    let contrast = |image: &[f32]| -> Result<f64, Box<dyn Error>> {
        let mean = |region| regions.mean(region, image).map_err(|e| e.0);
        let flank = Brighter::of(mean(Region::Left)?, mean(Region::Right)?).region();
        Ok(mean(Region::Footprint)? / mean(flank)? - 1.0)
    };
    Ok(contrast(image)? - contrast(&seen.extended)?)
}

fn write_pictures(seen: &Seen, name: &str, values: &[f32], maps: Maps, out: &Path) -> Result<(), Box<dyn Error>> {
    let at = |kind: &str| out.join(format!("{name}{kind}.png"));
    picture(seen, values, &at(""))?;
    map(seen, maps.signed, Scale::signed(0.15)?, &format!("{name}: test - reference"), &at("-signed"))?;
    map(seen, maps.ssim, Scale::similarity(0.0)?, &format!("{name}: SSIM"), &at("-ssim"))?;
    map(seen, maps.flip, Scale::flip(), &format!("{name}: FLIP"), &at("-flip"))
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("name the folder for the pictures")?;
    let out = Path::new(&folder);
    let scene = library::scene(SCENE)?;
    let geometry = Geometry::new(&scene)?;
    let look = Seen::new(&geometry, &scene, &scene.look.view())?;
    let measure_view = scene.measure.view();
    let measure = Seen::new(&geometry, &scene, &measure_view)?;
    let gbuffer = GBuffer::new(&geometry.tracer, &measure_view);
    let regions = Regions::new(&scene, &geometry.tracer, &gbuffer);
    let reference = grey(&look, &look.extended)?;
    picture(&look, &look.extended, &out.join("reference.png"))?;

    let mut rows: Vec<(&Distortion, f32, Scores, f64)> = Vec::new();
    for distortion in &DISTORTIONS {
        let amount = distortion.amount(&look);
        let image = distortion.image(&look, amount);
        let test = grey(&look, &image)?;
        let (found, maps) =
            scores(&Pair::new(&reference, &test, None)?, &Options { ssimulacra2: true, ..Options::default() })?;
        write_pictures(&look, distortion.name, &image, maps, out)?;
        let under = distortion.image(&measure, amount);
        rows.push((distortion, amount, found, contrast_error(&regions, &measure, &under)?));
    }
    let names: Vec<ScoreName> = rows[0].2.scores.iter().map(|s| s.name).collect();
    let mut text = String::from("| |");
    for (distortion, ..) in &rows {
        text += &format!(" **{}**: {} |", distortion.name, distortion.cause);
    }
    text += &format!("\n|---|{}", "--:|".repeat(rows.len()));
    text += "\n| amount |";
    for (_, amount, ..) in &rows {
        text += &format!(" {amount:.3} |");
    }
    for name in names {
        text += &format!("\n| {} |", name.label());
        for (_, _, found, _) in &rows {
            text += &found.value(name).map_or_else(|| " – |".to_owned(), |v| format!(" {v:.4} |"));
        }
    }
    text += "\n| dK against the reference |";
    for (_, _, _, error) in &rows {
        text += &format!(" {error:+.4} |");
    }
    use std::io::Write;
    Ok(writeln!(std::io::stdout(), "{text}")?)
}
