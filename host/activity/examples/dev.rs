#![allow(missing_docs, clippy::all, unused_imports, dead_code)]
use anyhow::Result;
use farnear_activity::{
    embedding::descriptor::Scaling,
    recognition::{
        choice::names,
        classifier::{Classifier, ClassifierKind},
        clip::{Clip, Track},
        frames::{Mode, Weights},
        space::{PatternKind, Space, SpaceSettings},
    },
    synthetic::everyday,
};
use ndarray::Array2;
use rayon::prelude::*;
use std::time::Instant;

#[path = "../../evaluation/src/people/skeletons.rs"]
mod skeletons;
#[path = "../../evaluation/src/people/strips.rs"]
mod strips;

fn numbered(folder: &str) -> Vec<(u64, std::path::PathBuf)> {
    let mut files: Vec<(u64, std::path::PathBuf)> = std::fs::read_dir(folder)
        .unwrap()
        .filter_map(|e| {
            let p = e.ok()?.path();
            let d: String = p.file_stem()?.to_str()?.chars().filter(char::is_ascii_digit).collect();
            Some((d.parse().ok()?, p))
        })
        .collect();
    files.sort();
    files
}

fn kth() -> Vec<Clip> {
    let mut clips = Vec::new();
    for person in ["person01", "person02"] {
        let mut runs: Vec<Vec<farnear_activity::mask::Mask>> = Vec::new();
        let mut previous = None;
        for (n, p) in numbered(&format!("/work/shared/data/kth_walk/{person}")) {
            let i = image::open(&p).unwrap().to_luma8();
            let m = farnear_activity::mask::Mask::from_shape_fn(
                (i.height() as usize, i.width() as usize),
                |(y, x)| i.get_pixel(x as u32, y as u32).0[0] > 127,
            );
            if previous.is_none_or(|q| n != q + 1) {
                runs.push(Vec::new());
            }
            previous = Some(n);
            if farnear_activity::mask::area(m.view()) >= 200 {
                runs.last_mut().unwrap().push(m);
            }
        }
        for run in runs.into_iter().filter(|r| r.len() >= 20) {
            clips.push(Clip {
                subject: person.into(),
                activity: "walk".into(),
                views: vec![Track::from_masks(&run, Scaling::default(), true)],
            });
        }
    }
    clips
}

fn weizmann() -> Vec<Clip> {
    let mut files = Vec::new();
    for (f, a) in [("0", "wave one"), ("1", "wave two"), ("3", "jack"), ("4", "bend")] {
        for (n, p) in numbered(&format!("/work/shared/data/weizmann4/{f}")) {
            files.push((n, a, p));
        }
    }
    files
        .into_par_iter()
        .map(|(n, a, p)| Clip {
            subject: format!("w{}", n / 8),
            activity: a.into(),
            views: vec![Track::from_masks(
                &strips::masks(&strips::read(&p).unwrap()),
                Scaling::default(),
                true,
            )],
        })
        .collect()
}

fn var(name: &str, default: f64) -> f64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

/// The model's name of a set's activity.
fn renamed(name: &str) -> &str {
    match name {
        "wave hands" => "wave two hands",
        "clap hands" => "clap",
        "wave one" | "wave" => "wave one hand",
        "wave two" => "wave two hands",
        "jack" => "jumping jack",
        "tight lace" => "tie laces",
        other => other,
    }
}

fn main() -> Result<()> {
    let t = Instant::now();
    let read = |n: &str| std::fs::read(format!("/work/shared/data/skeletons/{n}")).unwrap();
    let all: Vec<(&str, Vec<Clip>)> = vec![
        ("UTKinect", skeletons::utkinect(&read("UTKinect_Skeletons.mat"), 4, Scaling::default())?),
        ("Florence", skeletons::florence(&read("Florence_3D_Action_Skeletons.mat"), 4, Scaling::default())?),
        ("Weizmann", weizmann()),
        ("KTH", kth()),
    ];
    eprintln!("read in {:.1} s", t.elapsed().as_secs_f64());
    if let Ok(folder) = std::env::var("MODELS") {
        use farnear_activity::evaluation::calibration::*;
        use farnear_activity::recognition::model::Recogniser;
        for f in ["everyday", "everyday-order-free", "everyday-cut-out", "everyday-order-free-cut-out"] {
            let Ok(b) = std::fs::read(format!("{folder}/{f}.fnm")) else { continue };
            let m = Recogniser::from_bytes(&b).unwrap();
            eprintln!("{f} {} bytes", b.len());
            for (name, clips) in &all {
                let refs: Vec<&Clip> = clips.iter().collect();
                for tta in [false, true] {
                    let answer = |track: &Track| -> Vec<f32> {
                        let mut views = vec![track.clone()];
                        if tta {
                            views.push(track.mirrored());
                        }
                        m.recognise(&views).unwrap().probabilities.iter().map(|p| p.1).collect()
                    };
                    eprint!("{}", if tta { " mirrored too" } else { "" });
                    report(name, &refs, &m.activities, &answer);
                    // calibration and unknown among
                    let mut among: Vec<String> = clips
                        .iter()
                        .map(|c| renamed(&c.activity).to_owned())
                        .filter(|c| m.activities.contains(c))
                        .collect();
                    among.sort();
                    among.dedup();
                    let (mut r, mut ra, mut unknown, mut n) =
                        (Reliability::default(), Reliability::default(), 0, 0);
                    for c in clips {
                        for v in &c.views {
                            let mut views = vec![v.clone()];
                            if tta {
                                views.push(v.mirrored());
                            }
                            let a = m.recognise(&views).unwrap();
                            let b = a.among(&among);
                            let t = renamed(&c.activity).to_owned();
                            r.count(a.confidence, a.best() == Some(&t));
                            ra.count(b.confidence, b.best() == Some(&t));
                            unknown += u32::from(a.outlier_score > 1.0);
                            n += 1;
                        }
                    }
                    eprintln!(
                        "     ECE all {:.3} among {:.3}, unknown {:.1} %",
                        r.expected_error(),
                        ra.expected_error(),
                        100.0 * unknown as f64 / n as f64
                    );
                }
            }
        }
        return Ok(());
    }
    let people = var("PEOPLE", 20.0) as usize;
    let t = Instant::now();
    let training = everyday::clips(0, people, Scaling::default());
    eprintln!("made {} clips in {:.1} s", training.len(), t.elapsed().as_secs_f64());
    for (mode_name, mode) in [("order-free", Mode::OrderFree), ("ordered", Mode::Ordered)] {
        if var("ONLY", 0.0) == 1.0 && mode == Mode::OrderFree {
            continue;
        }
        let classes = names(training.iter().map(|c| &c.activity));
        let refs: Vec<&Clip> = training.iter().collect();
        let settings = SpaceSettings {
            mode,
            dimensions: var("DIM", 20.0) as usize,
            pattern: PatternKind::Codebook(var("BOOK", 200.0) as usize),
            residuals: var("RES", 32.0) as usize,
            gallery: 4000,
            weights: Weights {
                relative_weight: var("REL", 1.0) as f32,
                box_weight: var("BOX", 6.0) as f32,
                motion_weight: var("MOT", 0.7) as f32,
            },
            ..SpaceSettings::default()
        };
        let t = Instant::now();
        let space = Space::train(&refs, &settings)?;
        use farnear_activity::recognition::network::training::{NetworkSettings, train};
        let vectors = |track: &Track| space.vectors(track).expect("vectors");
        let mut rows: Vec<Array2<f32>> = training.par_iter().map(|c| vectors(&c.views[0])).collect();
        let mirror = var("MIRROR", 1.0) > 0.0;
        if mirror {
            rows.extend(training.par_iter().map(|c| vectors(&c.views[0].mirrored())).collect::<Vec<_>>());
        }
        let labels: Vec<usize> =
            training.iter().map(|c| classes.iter().position(|k| *k == c.activity).unwrap_or(0)).collect();
        let labels = if mirror { [labels.clone(), labels].concat() } else { labels };
        let w = var("WIDTH", 1.0);
        let (net, last) = train(
            &rows,
            &labels,
            classes.len(),
            &NetworkSettings {
                passes: var("PASSES", 30.0) as usize,
                rate: var("RATE", 2e-3) as f32,
                decay: var("DECAY", 1e-2) as f32,
                noise: var("NOISE", 0.2) as f32,
                dropout: var("DROP", 0.3) as f32,
                widths: [(64.0 * w) as usize, (128.0 * w) as usize, (96.0 * w) as usize],
                ..NetworkSettings::default()
            },
            &farnear_activity::recognition::watch::Unwatched,
        )
        .unwrap();
        eprintln!("{mode_name}: trained in {:.1} s", t.elapsed().as_secs_f64());
        let probabilities = |track: &Track| {
            let d = net.pattern(vectors(track).view()).dot(&last.weights) + &last.offsets;
            let m = d.iter().fold(f32::NEG_INFINITY, |m, v| m.max(*v));
            let e: Vec<f32> = d.iter().map(|v| (v - m).exp()).collect();
            let s: f32 = e.iter().sum();
            e.into_iter().map(|v| v / s).collect::<Vec<f32>>()
        };
        let fresh = everyday::clips(100_000, 4, Scaling::default());
        let mut judged = vec![("fresh synthetic", fresh.iter().collect::<Vec<_>>())];
        judged.extend(all.iter().map(|(n, c)| (*n, c.iter().collect())));
        for (name, clips) in judged {
            report(name, &clips, &classes, &probabilities);
        }
    }
    Ok(())
}

fn report(name: &str, clips: &[&Clip], classes: &[String], answer: &(dyn Fn(&Track) -> Vec<f32> + Sync)) {
    let known: Vec<&&Clip> =
        clips.iter().filter(|c| classes.iter().any(|k| k == renamed(&c.activity))).collect();
    let mut among: Vec<usize> =
        known.iter().filter_map(|c| classes.iter().position(|k| k == renamed(&c.activity))).collect();
    among.sort_unstable();
    among.dedup();
    let best =
        |p: &[f32], of: &[usize]| of.iter().copied().max_by(|a, b| p[*a].total_cmp(&p[*b])).unwrap_or(0);
    let everything: Vec<usize> = (0..classes.len()).collect();
    let results: Vec<(usize, Vec<Vec<f32>>)> = known
        .par_iter()
        .map(|c| {
            let truth = classes.iter().position(|k| k == renamed(&c.activity)).unwrap_or(0);
            (truth, c.views.iter().map(&answer).collect())
        })
        .collect();
    let (mut n, mut right, mut right_among, mut fused) = (0, 0, 0, 0);
    let mut by_view = vec![0; 8];
    let mut confusion = vec![vec![0; classes.len()]; classes.len()];
    let mut free = vec![vec![0; classes.len()]; classes.len()];
    for (truth, views) in &results {
        let mut sum = vec![0.0; classes.len()];
        for (v, p) in views.iter().enumerate() {
            n += 1;
            let b = best(p, &everything);
            right += usize::from(b == *truth);
            free[*truth][b] += 1;
            let a = best(p, &among);
            confusion[*truth][a] += 1;
            right_among += usize::from(a == *truth);
            by_view[v] += usize::from(a == *truth);
            for (s, p) in sum.iter_mut().zip(p) {
                *s += p.max(1e-6).ln();
            }
        }
        fused += usize::from(best(&sum, &among) == *truth);
    }
    let pc = |k: usize, n: usize| 100.0 * k as f64 / n.max(1) as f64;
    eprintln!(
        "  {name}: {} clips, all classes {:.1}, among {} {:.1}, fused among {:.1}; views {:?}",
        results.len(),
        pc(right, n),
        among.len(),
        pc(right_among, n),
        pc(fused, results.len()),
        by_view
            .iter()
            .take(results.first().map_or(0, |r| r.1.len()))
            .map(|k| pc(*k, results.len()).round())
            .collect::<Vec<_>>()
    );
    if std::env::var("CONF").is_ok()
        && (name != "fresh synthetic" || std::env::var("CONF").is_ok_and(|v| v == "2"))
    {
        for &t in &among {
            let total: usize = confusion[t].iter().sum();
            let list = |row: &Vec<usize>| {
                let mut l: Vec<(usize, usize)> =
                    row.iter().copied().enumerate().filter(|x| x.1 > 0).collect();
                l.sort_by_key(|x| std::cmp::Reverse(x.1));
                l.iter()
                    .take(5)
                    .map(|(k, c)| format!("{} {:.0}", classes[*k], pc(*c, total)))
                    .collect::<Vec<_>>()
                    .join(", ")
            };
            eprintln!("      {:>15}: {}   | {}", classes[t], list(&confusion[t]), list(&free[t]));
        }
    }
}
