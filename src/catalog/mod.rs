//! What is known about which digest: SQL and its migrations.
