//! From patterns to activities: k nearest neighbours or a linear SVC, with a confidence.

use super::knn;
use super::svc::LinearSvc;
use ndarray::{Array2, ArrayView1, ArrayView2};
use serde::{Deserialize, Serialize};

/// Which classifier, and its parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ClassifierKind {
    /// This many nearest neighbours.
    Knn(usize),
    /// Linear support vectors with this cost.
    Svc(f32),
}

/// A trained classifier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Classifier {
    /// Training patterns, their labels, and k.
    Knn {
        /// One training clip per row.
        patterns: Array2<f32>,
        /// Class of each row.
        labels: Vec<usize>,
        /// Number of classes.
        classes: usize,
        /// Neighbours that vote.
        k: usize,
    },
    /// Weights per class.
    Svc(LinearSvc),
}

impl Classifier {
    /// Trains on patterns (N x P) with labels below `classes`.
    pub fn train(kind: ClassifierKind, patterns: ArrayView2<f32>, labels: &[usize], classes: usize) -> Self {
        match kind {
            ClassifierKind::Knn(k) => {
                Self::Knn { patterns: patterns.to_owned(), labels: labels.to_vec(), classes, k }
            }
            ClassifierKind::Svc(c) => Self::Svc(LinearSvc::train(patterns, labels, classes, c)),
        }
    }

    /// Share of every class, adding up to 1: votes over k, or the softmax of the decision values.
    pub fn shares(&self, pattern: ArrayView1<f32>) -> Vec<f32> {
        match self {
            Self::Knn { patterns, labels, classes, k } => {
                let (votes, _) = knn::votes(patterns.view(), labels, *classes, *k, pattern);
                let total: f32 = votes.iter().sum();
                votes.into_iter().map(|v| v / total.max(1e-9)).collect()
            }
            Self::Svc(svc) => {
                /// Decision values lie about -1 to 1; this turns a margin of one into odds of twenty.
                const SLOPE: f32 = 3.0;
                let decision = svc.decide(pattern);
                let best = decision.iter().fold(f32::NEG_INFINITY, |m, v| m.max(*v));
                let raised: Vec<f32> = decision.iter().map(|v| (SLOPE * (v - best)).exp()).collect();
                let total: f32 = raised.iter().sum();
                raised.into_iter().map(|v| v / total).collect()
            }
        }
    }

    /// The class with the largest share (the first of equals) and the share.
    pub fn best(&self, pattern: ArrayView1<f32>) -> (usize, f32) {
        self.shares(pattern).into_iter().enumerate().fold((0, f32::NEG_INFINITY), |best, (class, share)| {
            if share > best.1 { (class, share) } else { best }
        })
    }
}
