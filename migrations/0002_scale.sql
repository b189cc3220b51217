-- Many processes on one catalog: what only holds because SQLite has one writer becomes foreign keys and row states.
-- The tables of 0001 are made anew with their tenant and their keys. Rows keep their ids; stored bytes keep their place,
-- as the empty generation is the path that 0001's program wrote.
-- TEXT, BIGINT and DOUBLE PRECISION only; times are milliseconds of the Unix epoch; digests are `b3-<64 hex>`.

ALTER TABLE measurements RENAME TO old_measurements;
ALTER TABLE materials RENAME TO old_materials;
ALTER TABLE material_sources RENAME TO old_material_sources;
ALTER TABLE material_tags RENAME TO old_material_tags;
ALTER TABLE jobs RENAME TO old_jobs;
ALTER TABLE idempotency_keys RENAME TO old_idempotency_keys;
DROP INDEX measurements_by_age;
DROP INDEX measurements_by_content;
DROP INDEX measurements_by_spectrum;
DROP INDEX materials_by_age;
DROP INDEX material_sources_by_measurement;
DROP INDEX jobs_by_state;
DROP INDEX jobs_by_measurement;
DROP INDEX jobs_by_report;
DROP TABLE pins;

-- Facts about this catalog: `instance`, its random id, which its store carries too; `store`, `claimed` once the store
-- has been given that id; `oldest_reader`, the lowest schema version whose program still understands this schema.
CREATE TABLE facts (
    name TEXT NOT NULL PRIMARY KEY,
    value TEXT NOT NULL
);
INSERT INTO facts (name, value) VALUES ('oldest_reader', '2');

CREATE TABLE tenants (
    id TEXT NOT NULL PRIMARY KEY,
    name TEXT NOT NULL UNIQUE,
    -- active, readonly or closed
    state TEXT NOT NULL DEFAULT 'active',
    -- Share of the workers, relative to the weights of others.
    weight BIGINT NOT NULL DEFAULT 100,
    max_bytes BIGINT NOT NULL DEFAULT 107374182400,
    max_queued BIGINT NOT NULL DEFAULT 10000,
    max_running BIGINT NOT NULL DEFAULT 64,
    max_jobs_day BIGINT NOT NULL DEFAULT 1000000,
    created_at BIGINT NOT NULL
);
INSERT INTO tenants (id, name, created_at) VALUES ('default', 'default', 0);

-- Bytes used by a tenant; several rows each, so that commits of one tenant do not wait for one row.
CREATE TABLE usage (
    tenant TEXT NOT NULL REFERENCES tenants (id),
    shard BIGINT NOT NULL,
    bytes BIGINT NOT NULL,
    blobs BIGINT NOT NULL,
    PRIMARY KEY (tenant, shard)
);

CREATE TABLE keys (
    id TEXT NOT NULL PRIMARY KEY,
    tenant TEXT NOT NULL REFERENCES tenants (id),
    name TEXT NOT NULL,
    hash TEXT NOT NULL,
    scopes TEXT NOT NULL,
    rate BIGINT,
    expires_at BIGINT,
    revoked_at BIGINT,
    used_at BIGINT,
    created_by TEXT,
    created_at BIGINT NOT NULL
);

-- Stored bytes: which object holds a digest. The object's name is made of tenant, digest and generation, and no name is
-- ever used twice. A row that names a digest refers to this table, so that its bytes cannot go.
CREATE TABLE blobs (
    tenant TEXT NOT NULL REFERENCES tenants (id),
    digest TEXT NOT NULL,
    generation TEXT NOT NULL,
    -- Size; -1 if it is not known yet.
    bytes BIGINT NOT NULL,
    -- 1 if the stored bytes were found missing or damaged: the next upload of the same bytes replaces them.
    suspect BIGINT NOT NULL DEFAULT 0,
    -- Time at which the digest was last computed from the stored bytes.
    checked_at BIGINT NOT NULL DEFAULT 0,
    created_at BIGINT NOT NULL,
    PRIMARY KEY (tenant, digest)
);

-- Objects that are being written: announced before the first byte, gone when a row of `blobs` refers to the object.
CREATE TABLE intents (
    object TEXT NOT NULL PRIMARY KEY,
    tenant TEXT NOT NULL,
    digest TEXT NOT NULL,
    bytes BIGINT NOT NULL,
    expires_at BIGINT NOT NULL
);

-- Objects to be deleted from the store, not before a time. An object is deleted only if it stands here.
CREATE TABLE doomed (
    object TEXT NOT NULL PRIMARY KEY,
    bytes BIGINT NOT NULL,
    not_before BIGINT NOT NULL,
    tries BIGINT NOT NULL DEFAULT 0
);

-- Digests that have lost a row that named them: a sweep looks whether another row still does.
CREATE TABLE unnamed (
    tenant TEXT NOT NULL,
    digest TEXT NOT NULL,
    not_before BIGINT NOT NULL,
    PRIMARY KEY (tenant, digest)
);

CREATE TABLE measurements (
    tenant TEXT NOT NULL,
    id TEXT NOT NULL,
    content TEXT NOT NULL,
    spectrum TEXT,
    name TEXT,
    file_name TEXT,
    bytes BIGINT NOT NULL,
    format TEXT NOT NULL,
    quantity TEXT,
    -- Lower case of the texts that a search looks into.
    search TEXT NOT NULL,
    -- JSON: what was understood of the file.
    document TEXT NOT NULL,
    created_at BIGINT NOT NULL,
    PRIMARY KEY (tenant, id),
    FOREIGN KEY (tenant, content) REFERENCES blobs (tenant, digest),
    FOREIGN KEY (tenant, spectrum) REFERENCES measurements (tenant, id)
);

CREATE TABLE materials (
    tenant TEXT NOT NULL,
    id TEXT NOT NULL,
    visibility TEXT NOT NULL DEFAULT 'private' CHECK (visibility IN ('private', 'public')),
    payload TEXT NOT NULL,
    quantity TEXT NOT NULL,
    bytes BIGINT NOT NULL,
    name TEXT,
    search TEXT NOT NULL,
    -- JSON: the manifest.
    document TEXT NOT NULL,
    created_at BIGINT NOT NULL,
    PRIMARY KEY (tenant, id),
    FOREIGN KEY (tenant, id) REFERENCES blobs (tenant, digest)
);

-- Materials that another tenant may read.
CREATE TABLE shares (
    tenant TEXT NOT NULL,
    material TEXT NOT NULL,
    reader TEXT NOT NULL REFERENCES tenants (id),
    created_at BIGINT NOT NULL,
    PRIMARY KEY (tenant, material, reader),
    FOREIGN KEY (tenant, material) REFERENCES materials (tenant, id) ON DELETE CASCADE
);

CREATE TABLE material_sources (
    tenant TEXT NOT NULL,
    material TEXT NOT NULL,
    measurement TEXT NOT NULL,
    PRIMARY KEY (tenant, material, measurement),
    FOREIGN KEY (tenant, material) REFERENCES materials (tenant, id) ON DELETE CASCADE,
    FOREIGN KEY (tenant, measurement) REFERENCES measurements (tenant, id)
);

CREATE TABLE material_tags (
    tenant TEXT NOT NULL,
    material TEXT NOT NULL,
    tag TEXT NOT NULL,
    PRIMARY KEY (tenant, material, tag),
    FOREIGN KEY (tenant, material) REFERENCES materials (tenant, id) ON DELETE CASCADE
);

-- Where each share of the queue stands: the rank that its next job gets. Jobs are started in the order of their ranks.
CREATE TABLE queue_shares (
    tenant TEXT NOT NULL REFERENCES tenants (id),
    share TEXT NOT NULL,
    next_rank BIGINT NOT NULL,
    used_at BIGINT NOT NULL,
    PRIMARY KEY (tenant, share)
);

CREATE TABLE jobs (
    id TEXT NOT NULL PRIMARY KEY,
    tenant TEXT NOT NULL REFERENCES tenants (id),
    -- Whose turn the job takes: the client's address, or the tenant.
    share TEXT NOT NULL,
    -- Lowest version of the queue's arguments that a worker must understand.
    level BIGINT NOT NULL DEFAULT 1,
    -- Hexadecimal bincode frame of the arguments.
    frame TEXT NOT NULL,
    -- Measurement that the job reads; a report reads none.
    measurement TEXT,
    -- The same while the job is queued or running, then NULL: afterwards the measurement may be deleted.
    needs TEXT,
    state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'dead', 'cancelled')),
    -- -1 urgent, 0 usual, 1 batch.
    priority BIGINT NOT NULL DEFAULT 0,
    rank BIGINT NOT NULL DEFAULT 0,
    progress DOUBLE PRECISION NOT NULL DEFAULT 0.0,
    -- Attempts that were started, without those whose worker vanished.
    attempts BIGINT NOT NULL DEFAULT 0,
    -- Attempts whose worker vanished.
    lost BIGINT NOT NULL DEFAULT 0,
    -- Number of the claim: what a worker writes names it, and a later claim has a higher one.
    epoch BIGINT NOT NULL DEFAULT 0,
    worker TEXT,
    lease_until BIGINT,
    not_before BIGINT NOT NULL,
    cancel_requested BIGINT NOT NULL DEFAULT 0,
    -- Until when somebody follows the job, so that its worker reports progress often.
    watched_until BIGINT NOT NULL DEFAULT 0,
    material TEXT,
    report TEXT,
    -- JSON: why it failed.
    problem TEXT,
    created_at BIGINT NOT NULL,
    updated_at BIGINT NOT NULL,
    FOREIGN KEY (tenant, needs) REFERENCES measurements (tenant, id),
    FOREIGN KEY (tenant, report) REFERENCES blobs (tenant, digest)
);

CREATE TABLE idempotency_keys (
    tenant TEXT NOT NULL,
    name TEXT NOT NULL,
    -- Digest of the request that came with the key.
    body TEXT NOT NULL,
    job TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
    created_at BIGINT NOT NULL,
    PRIMARY KEY (tenant, name)
);

-- Uploads that a client may continue after a break.
CREATE TABLE uploads (
    id TEXT NOT NULL PRIMARY KEY,
    tenant TEXT NOT NULL REFERENCES tenants (id),
    key TEXT,
    length BIGINT,
    received BIGINT NOT NULL,
    parts BIGINT NOT NULL,
    metadata TEXT NOT NULL,
    lease TEXT,
    lease_until BIGINT NOT NULL DEFAULT 0,
    expires_at BIGINT NOT NULL
);

CREATE TABLE audit (
    id TEXT NOT NULL PRIMARY KEY,
    at BIGINT NOT NULL,
    tenant TEXT,
    actor TEXT NOT NULL,
    action TEXT NOT NULL,
    subject TEXT,
    detail TEXT,
    address TEXT,
    request TEXT
);

INSERT INTO blobs (tenant, digest, generation, bytes, created_at)
    SELECT 'default', content, '', MAX(bytes), MIN(created_at) FROM old_measurements GROUP BY content;
INSERT INTO blobs (tenant, digest, generation, bytes, created_at)
    SELECT 'default', id, '', bytes, created_at FROM old_materials WHERE true
    ON CONFLICT (tenant, digest) DO NOTHING;
INSERT INTO blobs (tenant, digest, generation, bytes, created_at)
    SELECT 'default', report, '', -1, MIN(created_at) FROM old_jobs WHERE report IS NOT NULL GROUP BY report
    ON CONFLICT (tenant, digest) DO NOTHING;

-- A spectrum comes before what it was joined with.
INSERT INTO measurements (tenant, id, content, spectrum, name, file_name, bytes, format, quantity, search, document, created_at)
    SELECT 'default', id, content, NULL, name, file_name, bytes, format, quantity, search, document, created_at
    FROM old_measurements;
UPDATE measurements SET spectrum = (SELECT o.spectrum FROM old_measurements o WHERE o.id = measurements.id
    AND EXISTS (SELECT 1 FROM old_measurements s WHERE s.id = o.spectrum));
INSERT INTO materials (tenant, id, payload, quantity, bytes, name, search, document, created_at)
    SELECT 'default', id, payload, quantity, bytes, name, search, document, created_at FROM old_materials;
INSERT INTO material_sources (tenant, material, measurement)
    SELECT 'default', s.material, s.measurement FROM old_material_sources s
    WHERE EXISTS (SELECT 1 FROM old_materials m WHERE m.id = s.material)
    AND EXISTS (SELECT 1 FROM old_measurements m WHERE m.id = s.measurement);
INSERT INTO material_tags (tenant, material, tag)
    SELECT 'default', t.material, t.tag FROM old_material_tags t
    WHERE EXISTS (SELECT 1 FROM old_materials m WHERE m.id = t.material);
INSERT INTO jobs (id, tenant, share, frame, measurement, needs, state, progress, attempts, epoch, worker, lease_until,
    not_before, cancel_requested, material, report, problem, created_at, updated_at)
    SELECT id, 'default', '', frame, measurement,
        CASE WHEN state IN ('queued', 'running') AND EXISTS (SELECT 1 FROM old_measurements m WHERE m.id = measurement)
            THEN measurement END,
        state, progress, attempts, epoch, worker, lease_until, not_before, cancel_requested, material, report, problem,
        created_at, updated_at
    FROM old_jobs;
INSERT INTO idempotency_keys (tenant, name, body, job, created_at)
    SELECT 'default', k.name, k.body, k.job, k.created_at FROM old_idempotency_keys k
    WHERE EXISTS (SELECT 1 FROM old_jobs j WHERE j.id = k.job);

DROP TABLE old_idempotency_keys;
DROP TABLE old_jobs;
DROP TABLE old_material_tags;
DROP TABLE old_material_sources;
DROP TABLE old_materials;
DROP TABLE old_measurements;

CREATE INDEX blobs_by_check ON blobs (checked_at);
CREATE INDEX intents_by_expiry ON intents (expires_at);
CREATE INDEX doomed_by_time ON doomed (not_before);
CREATE INDEX unnamed_by_time ON unnamed (not_before);
CREATE INDEX measurements_by_age ON measurements (tenant, created_at, id);
CREATE INDEX measurements_by_content ON measurements (tenant, content);
CREATE INDEX measurements_by_spectrum ON measurements (tenant, spectrum);
CREATE INDEX materials_by_age ON materials (tenant, created_at, id);
CREATE INDEX materials_public ON materials (id, created_at) WHERE visibility = 'public';
CREATE INDEX material_sources_by_measurement ON material_sources (tenant, measurement);
CREATE INDEX jobs_waiting ON jobs (priority, rank, id) WHERE state = 'queued';
CREATE INDEX jobs_waiting_by_share ON jobs (tenant, share) WHERE state = 'queued';
CREATE INDEX jobs_running ON jobs (rank) WHERE state = 'running';
CREATE INDEX jobs_by_lease ON jobs (lease_until) WHERE state = 'running';
CREATE INDEX jobs_ended ON jobs (state, updated_at) WHERE state NOT IN ('queued', 'running');
CREATE INDEX jobs_needs ON jobs (tenant, needs) WHERE needs IS NOT NULL;
CREATE INDEX jobs_by_report ON jobs (tenant, report) WHERE report IS NOT NULL;
CREATE INDEX jobs_by_age ON jobs (tenant, created_at, id);
CREATE INDEX idempotency_keys_by_age ON idempotency_keys (created_at);
CREATE INDEX idempotency_keys_by_job ON idempotency_keys (job);
CREATE INDEX uploads_by_expiry ON uploads (expires_at);
CREATE INDEX audit_by_time ON audit (tenant, at, id);
