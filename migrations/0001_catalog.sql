-- TEXT, BIGINT and DOUBLE PRECISION only, so that SQLite and PostgreSQL read the same file. Times are milliseconds of
-- the Unix epoch. Digests are `b3-<64 hex>`.

-- What was uploaded. `id` is the content's digest, or the digest of content and interpretation options.
CREATE TABLE measurements (
    id TEXT NOT NULL PRIMARY KEY,
    content TEXT NOT NULL,
    spectrum TEXT,
    name TEXT,
    file_name TEXT,
    bytes BIGINT NOT NULL,
    format TEXT NOT NULL,
    quantity TEXT,
    -- Lower case of everything a search looks into.
    search TEXT NOT NULL,
    -- JSON: what was understood.
    document TEXT NOT NULL,
    created_at BIGINT NOT NULL
);
CREATE INDEX measurements_by_age ON measurements (created_at, id);
CREATE INDEX measurements_by_content ON measurements (content);
CREATE INDEX measurements_by_spectrum ON measurements (spectrum);

-- Compressed materials; `id` is the digest of the file.
CREATE TABLE materials (
    id TEXT NOT NULL PRIMARY KEY,
    payload TEXT NOT NULL,
    quantity TEXT NOT NULL,
    bytes BIGINT NOT NULL,
    name TEXT,
    search TEXT NOT NULL,
    -- JSON: the manifest.
    document TEXT NOT NULL,
    created_at BIGINT NOT NULL
);
CREATE INDEX materials_by_age ON materials (created_at, id);

-- Which measurements a material was made of: equal bytes may come from several.
CREATE TABLE material_sources (
    material TEXT NOT NULL,
    measurement TEXT NOT NULL,
    PRIMARY KEY (material, measurement)
);
CREATE INDEX material_sources_by_measurement ON material_sources (measurement);

CREATE TABLE material_tags (
    material TEXT NOT NULL,
    tag TEXT NOT NULL,
    PRIMARY KEY (material, tag)
);

-- Work. A running job belongs to whoever holds `epoch` until `lease_until`.
CREATE TABLE jobs (
    id TEXT NOT NULL PRIMARY KEY,
    -- Hexadecimal bincode frame of the arguments.
    frame TEXT NOT NULL,
    -- What it reads; a report reads none.
    measurement TEXT,
    state TEXT NOT NULL,
    progress DOUBLE PRECISION NOT NULL,
    attempts BIGINT NOT NULL,
    epoch BIGINT NOT NULL,
    worker TEXT,
    lease_until BIGINT,
    not_before BIGINT NOT NULL,
    cancel_requested BIGINT NOT NULL,
    material TEXT,
    -- The digest of a report's bytes, which stay as long as this row.
    report TEXT,
    -- JSON: why it failed.
    problem TEXT,
    created_at BIGINT NOT NULL,
    updated_at BIGINT NOT NULL
);
CREATE INDEX jobs_by_state ON jobs (state, not_before, id);
CREATE INDEX jobs_by_measurement ON jobs (measurement, state);
CREATE INDEX jobs_by_report ON jobs (report);

CREATE TABLE idempotency_keys (
    name TEXT NOT NULL PRIMARY KEY,
    body TEXT NOT NULL,
    job TEXT NOT NULL,
    created_at BIGINT NOT NULL
);

-- Digests that an upload or a job is about to name: a sweep leaves them alone until they expire.
CREATE TABLE pins (
    digest TEXT NOT NULL,
    holder TEXT NOT NULL,
    expires_at BIGINT NOT NULL,
    PRIMARY KEY (digest, holder)
);
