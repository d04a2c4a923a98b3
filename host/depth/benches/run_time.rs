//! Minimum and median times of the run time, of one convolution and of the operator designs, in ms. Where the
//! floating-point operations are known (`flop`: two per kernel tap as if taps shared nothing; `executed_flop`: executed
//! operations), `fma_peak` is the core's limit: multiply-adds in registers. `cargo bench -p farnear-depth [-- FILTER]`;
//! `FARNEAR_JSON=1` prints one JSON object per line. The images are random; nothing here can fail.
#![allow(clippy::unwrap_used, missing_docs)] // A benchmark may stop; it has no users.

use std::hint::black_box;
use std::time::Instant;

use farnear_depth::adaptive_window::{Bank, Window, WindowSettings, estimate};
use farnear_depth::fill::fill_low_texture;
use farnear_depth::filter::convolve;
use farnear_depth::kernel::Kernel;
use farnear_depth::measure::{DepthMethod, MeasureSettings, measure_pair};
use farnear_depth::operators::{Design, Family, Operators, Request, design};
use farnear_depth::optics::{Optics, OpticsFile};
use farnear_depth::pipeline::{Backend, Processor, Settings};
use farnear_depth::prepare::{Align, Balance, PrepareSettings, prepare};
use farnear_depth::stream::Stream;
use farnear_scene::{Camera, Lens, Renderer, Scene, standard};
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn optics(psf: &str) -> Optics {
    let mut file: OpticsFile = toml::from_str(standard::OPTICS).unwrap();
    file.psf = psf.parse().unwrap();
    file.check().unwrap()
}

fn random_image(height: usize, width: usize, seed: u64) -> Array2<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    Array2::from_shape_simple_fn((height, width), || rng.random_range(0.0..200.0_f32))
}

fn time<T>(runs: usize, mut run: impl FnMut() -> T) -> [f64; 2] {
    let mut ms: Vec<f64> = (0..runs + 2)
        .map(|_| {
            let start = Instant::now();
            black_box(run());
            1e3 * start.elapsed().as_secs_f64()
        })
        .skip(2)
        .collect();
    ms.sort_by(f64::total_cmp);
    [ms[0], ms[ms.len() / 2]]
}

/// Floating-point operations of a run, and those executed when shared work is done once.
struct Flop {
    plain: f64,
    executed: f64,
}

fn report(name: &str, backend: Option<Backend>, threads: usize, [min, median]: [f64; 2], flop: Option<Flop>) {
    let backend = backend.map_or("-".to_owned(), |b| format!("{b:?}").to_lowercase());
    if std::env::var_os("FARNEAR_JSON").is_some() {
        let flop = flop.map_or(String::new(), |flop| {
            format!(", \"flop\": {:.0}, \"executed_flop\": {:.0}", flop.plain, flop.executed)
        });
        println!(
            "{{\"name\": \"{name}\", \"backend\": \"{backend}\", \"threads\": {threads}, \"min_ms\": {min:.4}, \"median_ms\": {median:.4}{flop}}}"
        );
    } else {
        let flop = flop.map_or(String::new(), |flop| {
            let [plain, executed] = [flop.plain, flop.executed].map(|flop| 1e-6 * flop / min);
            format!("  {plain:.0} GFLOP/s, executed {executed:.0}")
        });
        println!("{name:<28} {backend:<9} threads {threads}  min {min:9.3} ms  median {median:9.3} ms{flop}");
    }
}

/// Time per pair with one independent single-threaded chain per thread: the machine's multi-thread limit.
fn side_by_side(threads: usize, rounds: usize, chain: impl Fn(&mut dyn FnMut()) + Sync) -> [f64; 2] {
    const PAIRS: usize = 3;
    let barrier = std::sync::Barrier::new(threads);
    let times = std::sync::Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                let mut pairs = 0;
                let mut start = Instant::now();
                chain(&mut || {
                    if pairs % PAIRS == 0 {
                        if barrier.wait().is_leader() && pairs > PAIRS {
                            let ms = 1e3 * start.elapsed().as_secs_f64();
                            times.lock().unwrap().push(ms / (PAIRS * threads) as f64);
                        }
                        barrier.wait();
                        start = Instant::now();
                    }
                    pairs += 1;
                });
            });
        }
    });
    let mut times = times.into_inner().unwrap();
    assert!(times.len() >= rounds, "{} rounds", times.len());
    times.sort_by(f64::total_cmp);
    [times[0], times[times.len() / 2]]
}

/// Alignment and balance of a pair, and adaptive windows; on all threads.
fn real_pair(optics: &Optics, [prepare_name, adaptive_name]: [&str; 2], size: (usize, usize), runs: usize) {
    let texture = random_image(size.0 + 2, size.1 + 2, 3);
    let part = |dy: usize, dx: usize| texture.slice(ndarray::s![dy..dy + size.0, dx..dx + size.1]).to_owned();
    let [far, near] = [part(0, 0), part(1, 2) * 1.1];
    let settings = PrepareSettings {
        align: Align::Similarity,
        balance: Balance::Local,
        limits: Some([0.0, 255.0]),
        ..PrepareSettings::default()
    };
    let threads = rayon::current_num_threads();
    let run = || prepare([far.clone(), near.clone()], optics, None, &settings).unwrap();
    report(prepare_name, None, threads, time(runs, run), None);
    let pair = run();
    let bank = Bank::whitened(optics).unwrap();
    let of_windows =
        WindowSettings { window: Window::Adaptive, median_px: 3, noise: pair.noise, backend: None };
    let adaptive = || estimate(pair.far.view(), pair.near.view(), &bank, optics, &of_windows).unwrap();
    report(adaptive_name, Some(Backend::best()), threads, time(runs, adaptive), None);
}

/// Rendered pairs of 8 bits, each with its own noise; their grey values are 0 to 1.
fn rendered(pairs: u32) -> Vec<[Array2<f32>; 2]> {
    let lens = Lens::from_optics(&farnear_scene::OpticsFile::parse(standard::OPTICS).unwrap()).unwrap();
    let (scene, psf): (Scene, _) = ("staircase".parse().unwrap(), "gaussian:k=0.4578".parse().unwrap());
    let camera = Camera::new(640, 480, farnear_scene::Noise::EightBit);
    let renderer = Renderer::new(&scene, &lens, &psf, &camera, 3).unwrap();
    let image = |sensor_mm: f64, exposure: u32| {
        renderer.expose(sensor_mm, exposure).unwrap().mapv(|code| f32::from(code) / 255.0)
    };
    (0..pairs).map(|i| [image(lens.sensor_far_mm, 2 * i), image(lens.sensor_near_mm, 2 * i + 1)]).collect()
}

/// Depth, standard deviation and reasons by the default method, of pairs alone or of pair after pair; on all threads.
fn live(name: &str, optics: &Optics) {
    let pairs = rendered(5);
    let mut next = pairs.iter().cycle().cloned();
    let mut next = || next.next().unwrap();
    let settings = MeasureSettings {
        prepare: PrepareSettings { limits: Some([0.0, 1.0]), ..PrepareSettings::default() },
        window: Window::Adaptive,
        ..MeasureSettings::default()
    };
    let mut stream = Stream::new(optics, &settings).unwrap();
    let times = if name == "live_640x480" {
        time(200, || stream.measure(next()).unwrap())
    } else {
        time(200, || measure_pair(next(), optics, DepthMethod::Whitened, None, &settings).unwrap())
    };
    report(name, Some(Backend::best()), rayon::current_num_threads(), times, None);
}

fn main() {
    let filter: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let wanted = |name: &str| filter.is_empty() || filter.iter().any(|f| name.contains(f.as_str()));
    let optics_pill = optics("pillbox");
    let operators = Operators::for_optics(&optics_pill).unwrap();
    let chain = |runs: usize, pair: &[Array2<f32>; 2], settings: &Settings| {
        let mut processor = Processor::new(&operators, &optics_pill, settings).unwrap();
        time(runs, || processor.run(pair[0].view(), pair[1].view()).unwrap().low_texture_fraction)
    };
    let vga = [1, 2].map(|seed| random_image(480, 640, seed));

    for backend in Backend::available() {
        if wanted("fma_peak") {
            const ROUNDS: u32 = 20_000;
            let flop = backend.multiply_adds(1) as f64 * f64::from(ROUNDS);
            report(
                "fma_peak",
                Some(backend),
                1,
                time(200, || backend.multiply_adds(ROUNDS)),
                Some(Flop { plain: flop, executed: flop }),
            );
        }
        if wanted("convolution_7x7") {
            let kernel: &Kernel = operators.prefilter();
            let mut output = Array2::zeros(vga[0].dim());
            report(
                "convolution_7x7",
                Some(backend),
                1,
                time(200, || convolve(vga[0].view(), kernel, backend, output.view_mut())),
                // Per pixel 49 multiply-adds; folded, 12 of them, 4 products and 10 sums.
                Some(Flop { plain: 98.0 * vga[0].len() as f64, executed: 38.0 * vga[0].len() as f64 }),
            );
        }
        for threads in [1, 4] {
            if wanted("chain_640x480") {
                let settings = Settings { threads, backend: Some(backend), ..Settings::default() };
                report("chain_640x480", Some(backend), threads, chain(200, &vga, &settings), None);
            }
        }
        if wanted("chain_640x480_side_by_side") {
            const THREADS: usize = 4;
            const ROUNDS: usize = 60;
            let settings = Settings { threads: 1, backend: Some(backend), ..Settings::default() };
            let times = side_by_side(THREADS, ROUNDS, |lap| {
                let mut processor = Processor::new(&operators, &optics_pill, &settings).unwrap();
                for _ in 0..(ROUNDS + 2) * 3 + 1 {
                    lap();
                    black_box(processor.run(vga[0].view(), vga[1].view()).unwrap().low_texture_fraction);
                }
            });
            report("chain_640x480_side_by_side", Some(backend), THREADS, times, None);
        }
    }
    for median_px in [5, 7] {
        if wanted("chain_median") {
            let settings = Settings { median_px, ..Settings::default() };
            report(
                &format!("chain_median_{median_px}"),
                Some(Backend::best()),
                1,
                chain(40, &vga, &settings),
                None,
            );
        }
    }
    if wanted("fill_640x480") {
        // A map with 20 discs of 30 px without texture.
        let texture = Array2::from_shape_fn((480, 640), |(y, x)| {
            let inside = (y % 120).abs_diff(60).pow(2) + (x % 128).abs_diff(64).pow(2) < 900;
            if inside { 0.0 } else { 1.0 }
        });
        let map = farnear_depth::pipeline::depth_from_pair(
            vga[0].view(),
            vga[1].view(),
            &operators,
            &optics_pill,
            &Settings::default(),
        )
        .unwrap();
        report(
            "fill_640x480",
            None,
            1,
            time(20, || fill_low_texture(&mut map.clone(), texture.view(), 9)),
            None,
        );
    }
    if wanted("chain_4000x3000") {
        let large = [1, 2].map(|seed| random_image(3000, 4000, seed));
        for threads in [1, 4] {
            let settings = Settings { threads, ..Settings::default() };
            report("chain_4000x3000", Some(Backend::best()), threads, chain(9, &large, &settings), None);
        }
    }
    for name in ["alone_640x480", "live_640x480"] {
        if wanted(name) {
            live(name, &optics("gaussian:k=0.4578"));
        }
    }
    for (name, height, width, runs) in [("640x480", 480, 640, 20), ("4000x3000", 3000, 4000, 3)] {
        let (prepare_name, adaptive_name) = (format!("prepare_{name}"), format!("windowed_{name}"));
        if wanted(&prepare_name) || wanted(&adaptive_name) {
            real_pair(&optics_pill, [&prepare_name, &adaptive_name], (height, width), runs);
        }
    }
    let designs = [
        (Family::Ro, "pillbox"),
        (Family::Watanabe, "pillbox"),
        (Family::Raj, "pillbox"),
        (Family::Gro, "gaussian:k=0.4578"),
        (Family::Ggro, "generalised:p=1.8,k=0.4802"),
    ];
    for (design_by, (family, psf)) in
        [Design::Linear, Design::Thesis].into_iter().flat_map(|d| designs.map(|f| (d, f)))
    {
        let request = Request { family, design: design_by, ..Request::for_optics(&optics(psf)) };
        let name = format!("design_{}_{}", request.family, request.design);
        if wanted(&name) {
            report(&name, None, 1, time(9, || design(&request)), None);
        }
    }
}
