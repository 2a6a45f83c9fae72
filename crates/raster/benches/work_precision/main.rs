//! Measures time against accuracy and size, and draws charts.
//!
//! ```text
//! cargo bench -p softrast-raster --bench work_precision
//! ```
//!
//! Writes `docs/studies/work_precision.svg` and `docs/studies/scaling.svg`, and both for colour images (`colour_work_precision.svg`,
//! `colour_scaling.svg`), each with its numbers as CSV. Times are medians, from world vertices to the gradient of a mean squared difference
//! to a disk; in colour including the gradient with respect to the vertex colours. Arguments after `--` select: `silhouette`, `colour` or
//! both.

mod chart;
#[allow(dead_code, reason = "the other benchmark uses the rest")]
#[path = "../coloured.rs"]
mod coloured;
#[path = "../machine.rs"]
mod machine;
#[path = "../scalar.rs"]
mod scalar;
#[allow(dead_code, reason = "other benchmarks use the rest")]
#[path = "../workload.rs"]
mod workload;

use std::{env, fs, hint::black_box, path::Path, sync::Arc, time::Instant};

use chart::Panel;
use coloured::Coloured;
use machine::machine;
use scalar::Scalar;
use softrast_mesh::icosphere;
use softrast_raster::{
    ColourRenderer, RasterBackend, TConorm, low_level::Silhouette, mse_loss, project, reference,
};
use softrast_softness::EdgeSoftness;
use softrast_tensor::{Autodiff, DType, NdArray, Tensor};
use workload::{SOFTNESS, Workload, disk, tensor};

type B32 = NdArray<f32>;
type B64 = NdArray<f64>;

/// Tolerance of the images used as exact ones.
const EXACT: f64 = 1e-12;
const REPEATS: usize = 15;
/// A point of the scaling chart takes at least three runs, and at most about this many seconds.
const SECONDS: f64 = 2.0;

fn main() -> anyhow::Result<()> {
    let words: Vec<String> = env::args().skip(1).collect();
    let asked = |what: &str| {
        let none = !words.iter().any(|word| word == "silhouette" || word == "colour");
        none || words.iter().any(|word| word == what)
    };
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/studies");
    fs::create_dir_all(&docs)?;
    let threads = rayon::current_num_threads();
    let header = format!("# {}\n", machine());
    let write = |name: &str, title: &str, panels: &[Panel], csv: &str| {
        fs::write(docs.join(name).with_extension("svg"), chart::svg(title, panels)?)?;
        anyhow::Ok(fs::write(docs.join(name).with_extension("csv"), csv)?)
    };
    if asked("silhouette") {
        let mut csv = format!(
            "{header}workload,method,tolerance,knots,pairs,ms,image_error,gradient_error\n"
        );
        let mut panels = Vec::new();
        for workload in [Workload::w1(), Workload::w2()] {
            println!("{}: exact to {:.1e}", workload.name, error_of_exact(&workload));
            panels.extend(work_precision(&workload, &mut csv));
        }
        let title =
            format!("Work and precision of a silhouette and its gradient ({threads} threads)");
        write("work_precision", &title, &panels, &csv)?;
        let mut csv = format!("{header}varied,faces,size,views,ms\n");
        let panels = scaling(&mut csv, |workload| {
            let scene = Scene::<B32>::new(workload, 1e-5, DType::F32);
            median(|| scene.draw()).ms
        });
        let title = format!("Time for a silhouette and its gradient ({threads} threads, f32)");
        write("scaling", &title, &panels, &csv)?;
    }
    if asked("colour") {
        let mut csv = format!("{header}workload,method,tolerance,ms,image_error,gradient_error\n");
        let mut panels = Vec::new();
        for workload in [Workload::w1(), Workload::w2()] {
            panels.extend(colour_work_precision(&workload, &mut csv));
        }
        let title = format!("Work and precision of colours and their gradient ({threads} threads)");
        write("colour_work_precision", &title, &panels, &csv)?;
        let mut csv = format!("{header}varied,faces,size,views,ms\n");
        let panels = scaling(&mut csv, |workload| {
            let scene = Coloured::<B32>::new(workload, ColourRenderer::DEPTH_SCALE, DType::F32);
            median(|| in_colour(&scene)).ms
        });
        let title = format!("Time for colours and their gradient ({threads} threads, f32)");
        write("colour_scaling", &title, &panels, &csv)?;
    }
    Ok(())
}

/// Both panels of a workload.
const PASSES: [&str; 2] = ["image", "gradient"];

/// An image and its gradient with respect to the world vertices, flat, and the time of both.
struct Drawn {
    image: Vec<f64>,
    gradient: Vec<f64>,
    ms: f64,
}

/// A workload in one float type, ready to draw.
struct Scene<B: RasterBackend> {
    silhouette: Silhouette<EdgeSoftness>,
    table: Tensor<B, 2>,
    world: Tensor<B, 3>,
    cameras: Tensor<B, 2>,
    target: Tensor<B, 3>,
}

impl<B: RasterBackend> Scene<B> {
    fn new(workload: &Workload, tolerance: f64, dtype: DType) -> Self {
        let (silhouette, table) = workload.prepare(tolerance, dtype);
        let cameras = workload.cameras(dtype);
        let size = workload.size;
        let target = tensor(&disk(size), [1, size, size], dtype);
        Self { silhouette, table, world: workload.world(dtype), cameras, target }
    }

    fn draw(&self) -> Drawn {
        let start = Instant::now();
        let up = |tensor: &Tensor<B, 2>| Tensor::<Autodiff<B>, 2>::from_inner(tensor.clone());
        let world = Tensor::<Autodiff<B>, 3>::from_inner(self.world.clone()).require_grad();
        let vertices = project(world.clone(), up(&self.cameras)).tensor();
        let image = self.silhouette.coverage_by_table(vertices, up(&self.table));
        let loss = mse_loss(image.clone(), Tensor::from_inner(self.target.clone())).mean();
        let gradient = world.grad(&loss.backward()).expect("the image depends on the vertices");
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let flat = |tensor: Tensor<B, 3>| tensor.into_data().iter().collect();
        Drawn { image: flat(image.inner()), gradient: flat(gradient), ms }
    }

    fn pairs(&self) -> usize {
        self.silhouette.pairs(project(self.world.clone(), self.cameras.clone()).tensor())
    }
}

/// Largest difference between the exact image and the reference, on the first 300 faces.
fn error_of_exact(workload: &Workload) -> f64 {
    let faces: Arc<[[u32; 3]]> = workload.faces[..300].into();
    let part = Workload {
        name: String::new(),
        faces: faces.clone(),
        vertices: workload.vertices.clone(),
        orbits: workload.orbits[..4].to_vec(),
        ..*workload
    };
    let (silhouette, table) = part.prepare::<B64>(EXACT, DType::F64);
    let vertices = part.projected::<B64>(DType::F64);
    let scene = reference::Scene { faces: &faces, size: part.size.into() };
    let t_conorm = TConorm::Probabilistic;
    let sums = reference::sums(scene, vertices.clone(), &SOFTNESS, t_conorm, part.phi(DType::F64));
    let image = silhouette.coverage_by_table(vertices, table);
    (t_conorm.coverage(sums) - image).abs().max().into_scalar()
}

/// Both panels of a workload: time against the error of the image and of the gradient.
fn work_precision(workload: &Workload, csv: &mut String) -> [Panel; 2] {
    let exact = Scene::<B64>::new(workload, EXACT, DType::F64).draw();
    let tolerances: Vec<f64> = (4..=16).map(|k| 10f64.powf(-0.5 * f64::from(k))).collect();
    let name = &workload.name;
    let mut series = [(); 4].map(|()| [Vec::new(), Vec::new()]);
    let mut add = |method: usize, label: [f64; 3], drawn: &Drawn| {
        let errors = [
            largest_difference(&drawn.image, &exact.image),
            relative_difference(&drawn.gradient, &exact.gradient),
        ];
        for (points, error) in series[method].iter_mut().zip(errors) {
            points.push([error, drawn.ms]);
        }
        let ([tolerance, knots, pairs], [image, gradient]) = (label, errors);
        let method = METHODS[method];
        *csv += &format!(
            "{name:?},{method:?},{tolerance:.2e},{knots},{pairs},{:.4},{image:.3e},{gradient:.3e}\n",
            drawn.ms
        );
    };
    for &tolerance in &tolerances {
        let scene = Scene::<B32>::new(workload, tolerance, DType::F32);
        let knots = scene.silhouette.profile().knots();
        let label = [tolerance, knots as f64, scene.pairs() as f64];
        add(0, label, &median(|| scene.draw()));
        let [radius, _] = scene.silhouette.profile().support();
        add(3, [tolerance, f64::NAN, f64::NAN], &median(|| plain(workload, radius as f32)));
        let scene = Scene::<B64>::new(workload, tolerance, DType::F64);
        add(1, label, &median(|| scene.draw()));
    }
    for bits in 0..=8 {
        let mut scene = Scene::<B32>::new(workload, 1e-8, DType::F32);
        scene.silhouette = scene.silhouette.with_cells(bits);
        scene.table = scene.silhouette.table(workload.phi(DType::F32));
        let knots = scene.silhouette.profile().knots();
        add(2, [1e-8, knots as f64, scene.pairs() as f64], &median(|| scene.draw()));
    }
    [("largest error of a pixel", 0), ("relative error of the gradient", 1)].map(|(x, which)| {
        let lines = METHODS.into_iter().zip(series.iter().map(|points| points[which].clone()));
        Panel::new(&format!("{name}: {}", PASSES[which]), x, lines)
    })
}

const METHODS: [&str; 4] = [
    "fused f32, tolerance 1e-2 to 1e-8",
    "fused f64, tolerance 1e-2 to 1e-8",
    "fused f32, 34 to 8,194 knots",
    "scalar f32, 1 thread, 1e-2 to 1e-8",
];

/// A colour image and its gradients, concatenated.
fn in_colour<B: RasterBackend>(scene: &Coloured<B>) -> Drawn {
    let (image, gradients, ms) = scene.step();
    let gradient = gradients.into_iter().flat_map(|of| of.into_data().iter().collect::<Vec<f64>>());
    Drawn { image: image.into_data().iter().collect(), gradient: gradient.collect(), ms }
}

/// Both panels of a workload in colour.
fn colour_work_precision(workload: &Workload, csv: &mut String) -> [Panel; 2] {
    let f32s = Coloured::<B32>::new(workload, ColourRenderer::DEPTH_SCALE, DType::F32);
    let f64s = Coloured::<B64>::new(workload, ColourRenderer::DEPTH_SCALE, DType::F64);
    let exact = in_colour(&f64s.clone().with_tolerance(EXACT));
    let mut series = [(); 2].map(|()| [Vec::new(), Vec::new()]);
    for tolerance in (4..=16).map(|k| 10f64.powf(-0.5 * f64::from(k))) {
        let (f32s, f64s) =
            (f32s.clone().with_tolerance(tolerance), f64s.clone().with_tolerance(tolerance));
        let drawn = [median(|| in_colour(&f32s)), median(|| in_colour(&f64s))];
        for ((series, drawn), method) in series.iter_mut().zip(&drawn).zip(METHODS) {
            let errors = [
                largest_difference(&drawn.image, &exact.image),
                relative_difference(&drawn.gradient, &exact.gradient),
            ];
            series
                .iter_mut()
                .zip(errors)
                .for_each(|(points, error)| points.push([error, drawn.ms]));
            let [image, gradient] = errors;
            *csv += &format!(
                "{:?},{method:?},{tolerance:.2e},{:.4},{image:.3e},{gradient:.3e}\n",
                workload.name, drawn.ms
            );
        }
    }
    [("largest error of a pixel", 0), ("relative error of the gradient", 1)].map(|(x, which)| {
        let lines = METHODS.into_iter().zip(series.iter().map(|points| points[which].clone()));
        Panel::new(&format!("{}: {}", workload.name, PASSES[which]), x, lines)
    })
}

/// The plain version with a given radius; projection and loss are tensor ops as for the others.
fn plain(workload: &Workload, radius: f32) -> Drawn {
    type A = Autodiff<B32>;
    let size = workload.size;
    let scale = (workload.width * workload.width) as f32;
    let scalar = Scalar { faces: &workload.faces, size, scale, radius };
    let count = workload.vertices.len() / 3;
    let target = tensor::<A, 3>(&disk(size), [1, size, size], DType::F32);

    let start = Instant::now();
    let world = workload.world::<A>(DType::F32).require_grad();
    let vertices = project(world.clone(), workload.cameras::<A>(DType::F32)).tensor();
    let views = vertices.dims()[0];
    let flat: Vec<f32> = vertices.clone().inner().into_data().iter().collect();
    let tensor_of = |values: Vec<f32>, shape: [usize; 3]| {
        let data = softrast_tensor::TensorData::new(values, shape);
        Tensor::<B32, 3>::from_data(data, (&Default::default(), DType::F32))
    };
    let sums = tensor_of(scalar.forward(&flat, count), [views, size, size]);
    let sums = Tensor::<A, 3>::from_inner(sums).require_grad();
    let image = TConorm::Probabilistic.coverage(sums.clone());
    let loss = mse_loss(image.clone(), target).mean();
    let upstream = sums.grad(&loss.backward()).expect("the loss depends on the sums");
    let upstream: Vec<f32> = upstream.into_data().iter().collect();
    let gradient = tensor_of(scalar.gradient(&flat, count, &upstream), [views, count, 3]);
    let pulled = (vertices * Tensor::from_inner(gradient)).sum();
    let gradient = world.grad(&pulled.backward()).expect("pixels depend on the vertices");
    let ms = start.elapsed().as_secs_f64() * 1e3;
    let flat = |tensor: Tensor<B32, 3>| tensor.into_data().iter().collect();
    Drawn { image: flat(image.inner()), gradient: flat(gradient), ms }
}

/// The last of several runs after one warm-up run, with their median time.
fn median(mut draw: impl FnMut() -> Drawn) -> Drawn {
    let start = Instant::now();
    let mut last = black_box(draw());
    let first = start.elapsed().as_secs_f64();
    let repeats = ((SECONDS / first) as usize).clamp(3, REPEATS);
    let mut times = Vec::with_capacity(repeats);
    for _ in 0..repeats {
        last = black_box(draw());
        times.push(last.ms);
    }
    times.sort_by(f64::total_cmp);
    Drawn { ms: times[repeats / 2], ..last }
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn relative_difference(a: &[f64], b: &[f64]) -> f64 {
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
    norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied())
}

/// Width of an edge in the scaling chart, in pixels.
const WIDTH_PX: f64 = 0.5;

/// The slopes are fitted to this many points with the longest times, where fixed costs are small.
const FITTED: usize = 4;

/// Slope of a straight line through the logarithms, by least squares.
fn slope(points: &[[f64; 2]]) -> f64 {
    let logs = points.iter().map(|point| point.map(f64::ln));
    let mean = |k: usize| logs.clone().map(|log| log[k]).sum::<f64>() / points.len() as f64;
    let (x, y) = (mean(0), mean(1));
    let sum = |of: fn(f64, f64) -> f64| logs.clone().map(|[a, b]| of(a - x, b - y)).sum::<f64>();
    sum(|x, y| x * y) / sum(|x, _| x * x)
}

/// Three panels: milliseconds, as returned by `time`, against faces, pixels and views, the other two fixed.
fn scaling(csv: &mut String, time: impl Fn(&Workload) -> f64) -> Vec<Panel> {
    let mut measure = |varied: &str, level: u32, size: usize, views: usize| {
        let azimuths: Vec<f64> = (0..views).map(|k| 360.0 * k as f64 / views as f64).collect();
        let workload = Workload {
            width: WIDTH_PX * 2.0 / size as f64,
            ..Workload::new("", &icosphere(level), &azimuths, size)
        };
        let (faces, ms) = (workload.faces.len(), time(&workload));
        *csv += &format!("{varied},{faces},{size},{views},{ms:.4}\n");
        [faces as f64, ms]
    };
    let faces: Vec<_> = (1..=8).map(|level| measure("faces", level, 256, 1)).collect();
    let sizes = [32, 64, 128, 256, 512, 1024, 2048];
    let pixels: Vec<_> =
        sizes.iter().map(|&n| [(n * n) as f64, measure("pixels", 4, n, 1)[1]]).collect();
    let counts = [1, 2, 4, 8, 16, 32, 64, 128];
    let views: Vec<_> = counts.iter().map(|&n| [n as f64, measure("views", 3, 64, n)[1]]).collect();
    let panel = |title: &str, x: &str, points: &[[f64; 2]]| {
        let [x0, y0] = *points.last().expect("a series has points");
        let line = points.iter().map(|[x, _]| [*x, y0 * x / x0]).collect();
        let title = format!("{title}: slope {:.2}", slope(&points[points.len() - FITTED..]));
        Panel::new(&title, x, [("measured", points.to_vec()), ("linear", line)])
    };
    vec![
        panel("256 x 256 pixels, 1 view", "faces", &faces),
        panel("5,120 faces, 1 view", "pixels", &pixels),
        panel("1,280 faces, 64 x 64 pixels", "views", &views),
    ]
}
