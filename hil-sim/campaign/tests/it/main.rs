mod replay;
mod scenarios;
