//! Bytes under their digest: publish, verify, sweep; knows nothing of measurements.
