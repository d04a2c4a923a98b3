mod everyday;
mod recognition;
