//! Confusion matrices and confidence intervals of accuracies.

use serde::{Deserialize, Serialize};

/// Counts of answers per true class.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Confusion {
    pub classes: Vec<String>,
    /// `counts[truth][answer]`.
    pub counts: Vec<Vec<u32>>,
}

impl Confusion {
    /// An empty matrix for these classes.
    pub fn new(classes: Vec<String>) -> Self {
        let n = classes.len();
        Self { classes, counts: vec![vec![0; n]; n] }
    }

    /// Adds one clip to the counts.
    pub fn count(&mut self, truth: usize, answer: usize) {
        self.counts[truth][answer] += 1;
    }

    /// Adds a matrix of the same classes.
    pub fn add(&mut self, other: &Self) {
        for (row, more) in self.counts.iter_mut().zip(&other.counts) {
            row.iter_mut().zip(more).for_each(|(count, more)| *count += more);
        }
    }

    /// Right answers and number of clips.
    pub fn right_of(&self) -> (u32, u32) {
        let right = (0..self.counts.len()).map(|i| self.counts[i][i]).sum();
        (right, self.counts.iter().flatten().sum())
    }

    /// Share of right answers, 0 to 1; NaN without clips.
    pub fn accuracy(&self) -> f64 {
        let (right, of) = self.right_of();
        f64::from(right) / f64::from(of)
    }

    /// Wilson's interval of the accuracy at 95 % (E. B. Wilson, JASA 22, 1927) for this number of independent
    /// trials: fewer than the answers if several views of a clip count.
    pub fn interval(&self, trials: u32) -> (f64, f64) {
        wilson(self.accuracy(), trials, 1.96)
    }

    /// Markdown table in per cent of each truth, as the thesis' tables 9.1 to 9.3.
    pub fn to_markdown(&self) -> String {
        let classes: Vec<String> = self.classes.iter().map(|name| name.replace('|', "\\|")).collect();
        let mut text = format!("| | {} |\n|---|{}\n", classes.join(" | "), "---|".repeat(classes.len()));
        for (name, row) in classes.iter().zip(&self.counts) {
            let total = row.iter().sum::<u32>().max(1);
            let cells: Vec<String> = row
                .iter()
                .map(|&count| format!("{:.1}", 100.0 * f64::from(count) / f64::from(total)))
                .collect();
            text.push_str(&format!("| {name} | {} |\n", cells.join(" | ")));
        }
        text
    }
}

/// Wilson's score interval of a share of right answers, 0 to 1, in `of` independent trials, at `z` standard deviations;
/// (0, 1) without trials.
pub fn wilson(share: f64, of: u32, z: f64) -> (f64, f64) {
    if of == 0 {
        return (0.0, 1.0);
    }
    let (n, p) = (f64::from(of), share);
    let centre = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    ((centre - half).max(0.0), (centre + half).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_has_its_published_values() {
        // Newcombe, Statistics in Medicine 17 (1998), table I: 81/263 and 15/148 by the score method.
        let (low, high) = wilson(81.0 / 263.0, 263, 1.959_964);
        assert!((low - 0.2553).abs() < 1e-4 && (high - 0.3662).abs() < 1e-4);
        let (low, high) = wilson(15.0 / 148.0, 148, 1.959_964);
        assert!((low - 0.0624).abs() < 1e-4 && (high - 0.1605).abs() < 1e-4);
        assert_eq!(wilson(0.0, 0, 1.96), (0.0, 1.0));
    }

    #[test]
    fn counts_and_table() {
        let mut matrix = Confusion::new(vec!["walk".into(), "dig".into()]);
        matrix.count(0, 0);
        matrix.count(0, 1);
        matrix.count(1, 1);
        assert_eq!(matrix.right_of(), (2, 3));
        // Three views of one clip are one trial.
        assert_eq!(matrix.interval(3), wilson(2.0 / 3.0, 3, 1.96));
        assert!(matrix.interval(1).0 < matrix.interval(3).0);
        assert!(matrix.to_markdown().contains("| walk | 50.0 | 50.0 |"));
    }
}
