//! Every call of the HTTP contract against a real server, and every refusal by its problem.

mod access;
mod away;
mod content;
mod copies;
mod crowd;
mod exports;
mod farm;
mod frames;
mod heads;
mod hostile;
#[cfg(target_os = "linux")]
mod isolation;
mod jobs;
mod keys;
mod made_elsewhere;
mod nodes;
mod partly;
mod queries;
mod resumable;
mod secure;
mod state;
mod streams;
mod uploads;
mod views;
mod whole;
