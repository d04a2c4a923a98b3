//! Self-training on unlabelled clips from another camera, sensor or laboratory: retrains the classifier on its surest
//! answers (Yarowsky, ACL 1995; equal shares per class: Zou et al., ECCV 2018). Requires mostly correct first answers.

use super::classifier::{Classifier, ClassifierKind, largest};
use ndarray::{Array2, ArrayView2, Axis, concatenate};

/// Rounds used by the command line.
pub const ROUNDS: usize = 3;
/// Share of each class' answers used in the first round, and the increase until the last.
const SHARES: [f64; 2] = [0.4, 0.5];

/// Labelled patterns, one per row.
#[derive(Clone, Copy, Debug)]
pub struct Labelled<'a> {
    /// Labelled patterns as rows.
    pub patterns: ArrayView2<'a, f32>,
    /// Classes of the patterns.
    pub labels: &'a [usize],
    /// Number of classes, larger than every label.
    pub classes: usize,
}

/// Trains on labelled patterns and, for `rounds`, on its own answers for others (one per row).
pub fn self_trained(
    kind: ClassifierKind,
    labelled: Labelled,
    others: ArrayView2<f32>,
    rounds: usize,
) -> Classifier {
    let Labelled { patterns, labels, classes } = labelled;
    let mut classifier = Classifier::train(kind, patterns, labels, classes);
    if others.nrows() == 0 {
        return classifier;
    }
    for round in 0..rounds {
        let share = SHARES[0] + SHARES[1] * round as f64 / rounds as f64;
        let answers: Vec<(usize, f32)> =
            others.rows().into_iter().map(|row| largest(&classifier.probabilities(row))).collect();
        let surest = surest(&answers, classes, share);
        let rows: Vec<usize> = surest.iter().map(|(row, _)| *row).collect();
        let all = concatenate(Axis(0), &[patterns, others.select(Axis(0), &rows).view()]);
        let all: Array2<f32> = all.unwrap_or_else(|_| patterns.to_owned());
        let names: Vec<usize> =
            labels.iter().copied().chain(surest.iter().map(|(_, class)| *class)).collect();
        classifier = Classifier::train(kind, all.view(), &names[..all.nrows()], classes);
    }
    classifier
}

fn surest(answers: &[(usize, f32)], classes: usize, share: f64) -> Vec<(usize, usize)> {
    let of_class = |class: usize| {
        let mut own: Vec<(f32, usize)> = answers
            .iter()
            .enumerate()
            .filter(|(_, (answer, _))| *answer == class)
            .map(|(row, (_, confidence))| (*confidence, row))
            .collect();
        own.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        own.truncate((own.len() as f64 * share).ceil() as usize);
        own.into_iter().map(move |(_, row)| (row, class))
    };
    (0..classes).flat_map(of_class).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    #[test]
    fn a_small_shift_of_the_clips_is_followed() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        // Two clouds; in the target both are 1.1 further right, so the old border splits the left one.
        let mut cloud = |moved: f32| {
            Array2::from_shape_fn((80, 2), |(i, k)| {
                let centre = if k == 0 { [-1.5, 1.5][i % 2] + moved } else { 0.0 };
                centre + rng.random_range(-0.7..0.7_f32)
            })
        };
        let (own, target) = (cloud(0.0), cloud(1.1));
        let labels: Vec<usize> = (0..80).map(|i| i % 2).collect();
        let labelled = Labelled { patterns: own.view(), labels: &labels, classes: 2 };
        let right = |rounds: usize| {
            let classifier = self_trained(ClassifierKind::Svc(1.0), labelled, target.view(), rounds);
            let answers = target.rows().into_iter().map(|row| classifier.best(row).0);
            answers.zip(&labels).filter(|(answer, label)| answer == *label).count()
        };
        let (before, after) = (right(0), right(6));
        assert!(before < 76 && after >= 79, "{before} {after}");
        let none = Array2::zeros((0, 2));
        let same = self_trained(ClassifierKind::Svc(1.0), labelled, none.view(), 3);
        assert_eq!(same, Classifier::train(ClassifierKind::Svc(1.0), own.view(), &labels, 2));
    }

    #[test]
    fn every_class_gives_its_surest() {
        let answers = [(0, 0.9), (0, 0.5), (1, 0.6), (0, 0.7), (1, 0.99)];
        assert_eq!(surest(&answers, 3, 0.5), [(0, 0), (3, 0), (4, 1)]);
    }
}
