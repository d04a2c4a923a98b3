//! Classifiers with probabilities per class. To add one, implement [`Method`] in a file of this module and
//! add a line to the table below.

pub mod method;
pub mod neighbours;
pub mod softmax;
pub mod svc;

use method::{Fold, Method};
use ndarray::{ArrayView1, ArrayView2};
use neighbours::Neighbours;
use serde::{Deserialize, Serialize};
use softmax::Softmax;
use svc::LinearSvc;

macro_rules! classifiers {
    ($($(#[$about:meta])* $name:ident($parameter:ty) => $trained:ty;)+) => {
        /// Classifier without parameter.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Family {
            $($(#[$about])* $name,)+
        }

        /// Classifier with its parameter.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "lowercase")]
        pub enum ClassifierKind {
            $($(#[$about])* $name($parameter),)+
        }

        /// A trained classifier.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        pub enum Classifier {
            $($(#[$about])* $name($trained),)+
        }

        impl Family {
            /// All classifiers of the table.
            pub const ALL: &[Self] = &[$(Self::$name,)+];

            /// Name in options, messages and files.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$name => <$trained as Method>::NAME,)+
                }
            }

            /// Candidate parameters, default first.
            pub fn tried(self) -> Vec<ClassifierKind> {
                match self {
                    $(Self::$name => {
                        <$trained as Method>::TRIED.iter().map(|&value| ClassifierKind::$name(value)).collect()
                    })+
                }
            }
        }

        impl ClassifierKind {
            /// Parameter as text, e.g. `k = 3`.
            pub fn described(self) -> String {
                match self {
                    $(Self::$name(parameter) => <$trained as Method>::described(parameter),)+
                }
            }

            pub(super) fn right(self, fold: &Fold) -> usize {
                let answers = match self {
                    $(Self::$name(parameter) => <$trained as Method>::answers(fold, parameter),)+
                };
                answers.iter().zip(fold.held).filter(|&(&answer, &row)| answer == fold.labels[row]).count()
            }
        }

        impl Classifier {
            /// Trains on patterns (N x P) with labels below `classes`.
            pub fn train(
                kind: ClassifierKind,
                patterns: ArrayView2<f32>,
                labels: &[usize],
                classes: usize,
            ) -> Self {
                match kind {
                    $(ClassifierKind::$name(parameter) => {
                        Self::$name(<$trained as Method>::train(patterns, labels, classes, parameter))
                    })+
                }
            }

            /// Probabilities per class with sum 1.
            pub fn probabilities(&self, pattern: ArrayView1<f32>) -> Vec<f32> {
                match self {
                    $(Self::$name(trained) => trained.probabilities(pattern),)+
                }
            }

            /// Whether sizes match, as a model file may hold anything.
            pub(super) fn fits(&self, width: usize, classes: usize) -> bool {
                match self {
                    $(Self::$name(trained) => trained.fits(width, classes),)+
                }
            }
        }
    };
}

// Model files number them in this order: append new ones.
classifiers! {
    /// Number of nearest neighbours.
    Knn(usize) => Neighbours;
    /// Linear support vectors with this cost.
    Svc(f32) => LinearSvc;
    /// Multinomial logistic regression with this cost.
    Softmax(f32) => Softmax;
}

impl std::fmt::Display for Family {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Family {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.iter().copied().find(|family| family.name() == text).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|family| family.name()).collect();
            format!("unknown classifier `{text}`: expected {}", names.join(" or "))
        })
    }
}

impl Classifier {
    /// Most probable class (the first of equals) and its probability.
    pub fn best(&self, pattern: ArrayView1<f32>) -> (usize, f32) {
        largest(&self.probabilities(pattern))
    }
}

/// Index of the largest value (the first of equals), and the value.
pub(crate) fn largest(values: &[f32]) -> (usize, f32) {
    let best = |best: (usize, f32), (place, value): (usize, &f32)| {
        if *value > best.1 { (place, *value) } else { best }
    };
    values.iter().enumerate().fold((0, f32::NEG_INFINITY), best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;
    use rand::{Rng, SeedableRng};

    #[test]
    fn all_tell_separable_classes_apart_trained_and_over_folds() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(9);
        let centres = [[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]];
        let labels: Vec<usize> = (0..60).map(|i| i % 3).collect();
        let patterns =
            Array2::from_shape_fn((60, 2), |(i, k)| centres[labels[i]][k] + rng.random_range(-1.0..1.0_f32));
        let gram = patterns.dot(&patterns.t());
        let (kept, held): (Vec<usize>, Vec<usize>) = (0..60).partition(|i| i % 4 > 0);
        for &family in Family::ALL {
            assert_eq!(family.name().parse(), Ok(family));
            let kind = family.tried()[0];
            let trained = Classifier::train(kind, patterns.view(), &labels, 3);
            for (pattern, &label) in patterns.rows().into_iter().zip(&labels) {
                let probabilities = trained.probabilities(pattern);
                assert!((probabilities.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{kind:?} {probabilities:?}");
                assert_eq!(trained.best(pattern).0, label, "{kind:?}");
            }
            let fold = Fold { gram: gram.view(), kept: &kept, held: &held, labels: &labels, classes: 3 };
            assert_eq!(kind.right(&fold), held.len(), "{kind:?}");
            assert!(trained.fits(2, 3) && !trained.fits(3, 3) && !trained.fits(2, 4), "{kind:?}");
        }
        assert!("forest".parse::<Family>().expect_err("none").contains("knn or svc or softmax"));
    }
}
