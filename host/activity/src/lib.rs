//! Silhouettes, shadows, embedding and activity recognition; pure, no input or output.
