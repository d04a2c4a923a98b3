//! Compares a batch with a plain loop (one thread, shared operators, no records): processor time per pair and
//! peak memory. `cargo run --release --example batch_speed -- [PAIRS] [FOLDER]`; figures in docs/batch.md.

use std::{
    error::Error,
    fs,
    path::{Path, PathBuf},
};

use farnear_files::image_file::encode_png;
use farnear_workflows::{
    Context,
    batch::{self, BatchSettings},
    depth::DepthRequest,
    request::Request,
};
use ndarray::Array2;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const SIZE: (usize, usize) = (480, 640);
const BLOCK: usize = 10;
const WRITE: &str = "npy";
const OPTICS: &str = "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n\
                      [focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n[psf]\nmodel = \"gaussian\"\nk = 0.4578\n";

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let pairs: usize = arguments.next().map_or(Ok(200), |text| text.parse())?;
    let root =
        arguments.next().map_or_else(|| std::env::temp_dir().join("farnear-batch-speed"), PathBuf::from);
    if root.exists() {
        fs::remove_dir_all(&root)?;
    }
    fs::create_dir_all(&root)?;
    fs::write(root.join("optics.toml"), OPTICS)?;
    (0..pairs).try_for_each(|number| pair(&root, number))?;
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let context = Context::unattended();
    // Warm up: operators are designed, files are in the system's cache.
    one.install(|| by_loop(&root, 0..BLOCK.min(pairs), &context, "warm"))?;
    let (mut of_batch, mut of_loop) = (Vec::new(), Vec::new());
    for begin in (0..pairs).step_by(BLOCK) {
        let block = begin..(begin + BLOCK).min(pairs);
        let count = block.len() as f64;
        let start = processor_seconds()?;
        one.install(|| by_loop(&root, block.clone(), &context, "loop"))?;
        let middle = processor_seconds()?;
        by_batch(&root, block)?;
        of_loop.push((middle - start) / count);
        of_batch.push((processor_seconds()? - middle) / count);
    }
    let (batch_ms, loop_ms) = (1e3 * median(&mut of_batch), 1e3 * median(&mut of_loop));
    let (least_batch_ms, least_loop_ms) = (1e3 * of_batch[0], 1e3 * of_loop[0]);
    println!("pairs of {}x{}: {pairs} by each way, blocks of {BLOCK}, write = {WRITE}", SIZE.1, SIZE.0);
    println!("processor time per pair, median: batch {batch_ms:.2} ms, loop {loop_ms:.2} ms");
    println!("                          least: batch {least_batch_ms:.2} ms, loop {least_loop_ms:.2} ms");
    println!(
        "throughput of the batch over that of the loop: {:.3} (median), {:.3} (least)",
        loop_ms / batch_ms,
        least_loop_ms / least_batch_ms
    );
    println!("most memory of this process: {}", peak()?);
    fs::remove_dir_all(root)?;
    Ok(())
}

/// Writes a texture and its defocused copy.
fn pair(root: &Path, number: usize) -> Result<()> {
    let texture = |y: usize, x: usize| 40 + (y * 31 + x * 17 + number * 5) * (y + 7) * 7919 % 151;
    for (name, spread) in [("far", 1), ("near", 2)] {
        let pixels = Array2::from_shape_fn(SIZE, |(y, x)| {
            let sum: usize = (0..spread * spread).map(|i| texture(y + i / spread, x + i % spread)).sum();
            (sum / (spread * spread)) as u16
        });
        fs::write(root.join(format!("{name}{number}.png")), encode_png(pixels.view(), 8)?)?;
    }
    Ok(())
}

fn by_loop(
    root: &Path,
    numbers: std::ops::Range<usize>,
    context: &Context<'_>,
    to: &str,
) -> farnear_workflows::Result<()> {
    for number in numbers {
        let request = DepthRequest {
            far: root.join(format!("far{number}.png")),
            near: root.join(format!("near{number}.png")),
            optics: Some(root.join("optics.toml")),
            threads: 1,
            write: WRITE.parse().unwrap_or_default(),
            out: Some(root.join(to).join(number.to_string())),
            ..DepthRequest::default()
        };
        request.run(context)?;
    }
    Ok(())
}

fn by_batch(root: &Path, numbers: std::ops::Range<usize>) -> Result<()> {
    let mut text = format!("[depth]\noptics = 'optics.toml'\nwrite = '{WRITE}'\n");
    for number in numbers {
        let job = "[[job]]\ndo = 'depth'\n";
        text += &format!("{job}far = 'far{number}.png'\nnear = 'near{number}.png'\nout = 'batch/{number}'\n");
    }
    let manifest = root.join("block.toml");
    fs::write(&manifest, text)?;
    let settings = BatchSettings {
        manifest,
        jobs: 1,
        shard: Default::default(),
        verify: false,
        failures: None,
        summary: None,
        dry_run: false,
        allow_failures: false,
    };
    batch::run(&settings, &Context::unattended(), &|_| Ok(()))?;
    Ok(())
}

/// User and system time of this process so far.
fn processor_seconds() -> Result<f64> {
    let text = fs::read_to_string("/proc/self/stat")?;
    let (_, fields) = text.rsplit_once(") ").ok_or("no end of the name")?;
    let ticks =
        fields.split(' ').skip(11).take(2).map(str::parse::<f64>).sum::<std::result::Result<f64, _>>()?;
    Ok(ticks / 100.0)
}

fn peak() -> Result<String> {
    let text = fs::read_to_string("/proc/self/status")?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:")).ok_or("no VmHWM")?;
    Ok(line.trim().into())
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
