//! Trained on one laboratory's clips, tested on another's.

use anyhow::{Context, Result};
use farnear_recognition::alignment::Alignment;
use farnear_recognition::choice::Views;
use farnear_recognition::classifier::Family;
use farnear_recognition::clip::Clip;
use farnear_recognition::evaluation::leave_one_out::train_on_others;
use farnear_recognition::experiment::Experiment;
use farnear_recognition::frames::Mode;
use farnear_recognition::model::Recogniser;
use farnear_recognition::self_training::ROUNDS;
use farnear_recognition::space::SpaceSettings;
use farnear_recognition::watch::Unwatched;

use super::{data::Data, everyday::MODELS, sets};
use crate::page::Page;

/// Equal activities with different names.
const SAME: [(&str, &str); 6] = [
    ("wave hands", "wave"),
    ("clap hands", "clap"),
    ("wave one", "wave"),
    ("wave two", "wave two hands"),
    ("bend", "bow"),
    ("jack", "jumping jack"),
];
/// UTKinect waves with both hands; other names distinguish one and two.
const BOTH_HANDS: (&str, &str) = ("wave hands", "wave two hands");

struct Pair {
    name: &'static str,
    activities: Vec<&'static str>,
    train: Vec<Clip>,
    test: Vec<Clip>,
    clips: usize,
    asked: [&'static str; 2],
}

struct Way {
    name: &'static str,
    features: bool,
    align: Alignment,
    self_training: usize,
}

const WAYS: [Way; 6] = [
    Way { name: "codebook, as before", features: false, align: Alignment::None, self_training: 0 },
    Way { name: "codebook, spread aligned", features: false, align: Alignment::Spread, self_training: 0 },
    Way { name: "codebook, CORAL", features: false, align: Alignment::Coral, self_training: 0 },
    Way { name: "codebook, self-training", features: false, align: Alignment::None, self_training: ROUNDS },
    Way { name: "features of `everyday`", features: true, align: Alignment::None, self_training: 0 },
    Way {
        name: "features of `everyday`, self-training",
        features: true,
        align: Alignment::None,
        self_training: ROUNDS,
    },
];

/// Mode, and whether silhouettes are cut out, of each of [`MODELS`].
const KINDS: [(Mode, bool); 4] =
    [(Mode::Ordered, false), (Mode::Ordered, true), (Mode::OrderFree, false), (Mode::OrderFree, true)];

pub fn measure(page: &mut Page, data: &Data) -> Result<()> {
    page.heading("From one set to another");
    let read = [sets::utkinect, sets::florence, sets::weizmann].map(|read| read(data));
    let [Some(utkinect), Some(florence), Some(strips)] = read.map(|set| set.ok().flatten()) else {
        page.paragraph("Skipped: UTKinect, Florence and the strips are not all at hand.");
        return Ok(());
    };
    page.paragraph(
        "Trained on the clips of one set that do what the other set holds too, every view by itself, tested on all views of the other by themselves, default settings. *Codebook* learns \
         everything from the training set. *Spread aligned* and *CORAL* bring the mean and spread, or covariance, of the test clips' frames to those of the training clips (`--align`), *self-training* learns on from the \
         surest answers for the test clips in three rounds (`--adapt`); none of them looks at a test clip's name. *Features* are what the network of a model that comes with the program makes of a clip, with a \
         classifier trained on the training set (`--features everyday`). The way was chosen after these figures had been seen. Sitting down and standing up are each other's reverse: without order, only the cut of the clips distinguishes them. UTKinect's waving is with both hands, Florence's with one. In brackets the 95 % interval (Wilson) for as many trials as there are test clips.",
    );
    let pairs = pairs(&utkinect.clips, &florence.clips, &strips.clips);
    let mut rows = Vec::new();
    for pair in &pairs {
        for ((mode, cut_out), (mode_name, kind, network)) in KINDS.into_iter().zip(MODELS) {
            let mut row = vec![pair.name.to_owned(), mode_name.to_owned(), kind.to_owned()];
            for way in &WAYS {
                eprintln!("    {}, {mode_name}, {kind}, {}", pair.name, way.name);
                row.push(accuracy(pair, mode, cut_out, network, way)?);
            }
            row.push(pair.asked[usize::from(mode == Mode::Ordered)].to_owned());
            rows.push(row);
        }
    }
    let mut head = vec!["sets", "mode", "silhouettes"];
    head.extend(WAYS.iter().map(|way| way.name));
    head.push("asked for");
    page.table(3, &head, &rows);
    for pair in &pairs {
        page.paragraph(&format!(
            "{}: {} clips in one view teach {}; {} are recognised.",
            pair.name,
            pair.train.len(),
            pair.activities.join(", "),
            pair.test.len()
        ));
    }
    Ok(())
}

fn pairs(utkinect: &[Clip], florence: &[Clip], strips: &[Clip]) -> Vec<Pair> {
    let four = vec!["clap", "sit down", "stand up", "wave"];
    let three = vec!["bow", "wave", "wave two hands"];
    let pair = |name, activities: &Vec<&'static str>, train: Vec<Clip>, test: &[Clip], asked| {
        let test = common(test, activities, &SAME);
        Pair { name, activities: activities.clone(), train, clips: test.len(), test: apart(&test), asked }
    };
    let joints = [common(florence, &three, &SAME), common(utkinect, &three, &[BOTH_HANDS])].concat();
    vec![
        pair("UTKinect to Florence", &four, apart(&common(utkinect, &four, &SAME)), florence, ["80", "92"]),
        pair("Florence to UTKinect", &four, apart(&common(florence, &four, &SAME)), utkinect, ["88", "99"]),
        pair("joints of both to strips", &three, apart(&joints), strips, ["95 / 90", "95 / 90"]),
    ]
}

fn common(clips: &[Clip], activities: &[&str], same: &[(&str, &str)]) -> Vec<Clip> {
    let named = clips.iter().map(|clip| {
        let found = same.iter().find(|(own, _)| *own == clip.activity);
        let activity = found.map_or(clip.activity.as_str(), |(_, shared)| shared).to_owned();
        Clip { activity, ..clip.clone() }
    });
    named.filter(|clip| activities.contains(&clip.activity.as_str())).collect()
}

/// Views as clips of their own.
pub fn apart(clips: &[Clip]) -> Vec<Clip> {
    clips
        .iter()
        .flat_map(|clip| clip.views.iter().map(|view| Clip { views: vec![view.clone()], ..clip.clone() }))
        .collect()
}

fn accuracy(pair: &Pair, mode: Mode, cut_out: bool, network: &[u8], way: &Way) -> Result<String> {
    let kept = |clips: &[Clip], mark: &str| -> Vec<Clip> {
        let mut clips = clips.to_vec();
        for clip in &mut clips {
            // Subjects of different sets are different people.
            clip.subject = format!("{mark} {}", clip.subject);
            if cut_out {
                clip.views.iter_mut().for_each(|view| view.boxes = None);
            }
        }
        clips
    };
    let experiment = if way.features {
        let model = Recogniser::from_bytes(network).context("a model that comes with the program")?;
        Experiment::on_features(model.space, Family::Svc)
    } else {
        Experiment::codebook(SpaceSettings { mode, ..SpaceSettings::default() })
    };
    let experiment = Experiment { align: way.align, self_training: way.self_training, ..experiment.fixed() };
    let (train, test) = (kept(&pair.train, "train"), kept(&pair.test, "test"));
    let outcome = train_on_others(&train, &test, &experiment, &[Views::Each], &Unwatched)?;
    let (low, high) = outcome.each.interval(pair.clips as u32);
    Ok(format!("{:.1} ({:.0} to {:.0})", 100.0 * outcome.each.accuracy(), 100.0 * low, 100.0 * high))
}
