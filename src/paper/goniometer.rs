//! goniometer
