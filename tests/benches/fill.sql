-- Fills an empty catalog on PostgreSQL with :jobs jobs, and with :materials materials of as many measurements.
-- The newest jobs wait (a fiftieth, 10,000 at most) or run (a fiftieth, 1,000 at most); the others have ended within 60
-- days: one in 5,000 is dead, one in 20 has failed, one in 25 was cancelled, one in 100 has made a report.
-- The leases of half of those that run are over. Documents are :measurement_document and :material_document. Foreign
-- keys are not checked meanwhile; all of them hold.
SET session_replication_role = replica;
CREATE FUNCTION pg_temp.now_ms() RETURNS BIGINT LANGUAGE SQL AS 'SELECT CAST(EXTRACT(EPOCH FROM now()) * 1000 AS BIGINT)';
CREATE FUNCTION pg_temp.digest(kind TEXT, i BIGINT) RETURNS TEXT LANGUAGE SQL IMMUTABLE AS
    $$SELECT 'b3-' || md5(kind || i) || md5(i || kind)$$;
CREATE FUNCTION pg_temp.object(kind TEXT, i BIGINT) RETURNS TEXT LANGUAGE SQL IMMUTABLE AS
    $$SELECT 'blobs/default/' || substr(md5(kind || i), 1, 2) || '/' || pg_temp.digest(kind, i) || '.' || md5(i || kind)$$;
INSERT INTO blobs (tenant, digest, generation, bytes, created_at)
    SELECT 'default', pg_temp.digest(kind, i), md5(i || kind), 100000, pg_temp.now_ms() - 1000 * i
    FROM generate_series(1, :materials) AS i, (VALUES ('content'), ('material')) AS kinds (kind);
INSERT INTO blobs (tenant, digest, generation, bytes, created_at)
    SELECT 'default', pg_temp.digest('report', i), md5(i || 'report'), 2000, pg_temp.now_ms()
    FROM generate_series(100, :jobs, 100) AS i;
INSERT INTO measurements (tenant, id, content, name, file_name, bytes, format, quantity, search, document, created_at)
    SELECT 'default', pg_temp.digest('measurement', i), pg_temp.digest('content', i), 'sample ' || i, 'sample-' || i || '.csv',
        100000, CASE WHEN i % 5000 = 0 THEN 'ies' ELSE 'csv' END, CASE WHEN i % 5000 = 0 THEN 'edf' ELSE 'brdf' END,
        'sample ' || i || chr(10) || 'sample-' || i || '.csv', :measurement_document,
        pg_temp.now_ms() - 1000 * (:materials - i)
    FROM generate_series(1, :materials) AS i;
INSERT INTO materials (tenant, id, payload, quantity, bytes, name, search, document, created_at)
    SELECT 'default', pg_temp.digest('material', i), pg_temp.digest('payload', i),
        CASE WHEN i % 5000 = 0 THEN 'edf' ELSE 'brdf' END, 3000, 'sample ' || i,
        'sample ' || i || chr(10) || 'tag' || i % 100 || CASE WHEN i % 5000 = 1 THEN chr(10) || 'rare' ELSE '' END,
        :material_document,
        pg_temp.now_ms() - 1000 * (:materials - i)
    FROM generate_series(1, :materials) AS i;
INSERT INTO material_sources (tenant, material, measurement)
    SELECT 'default', pg_temp.digest('material', i), pg_temp.digest('measurement', i) FROM generate_series(1, :materials) AS i;
INSERT INTO material_tags (tenant, material, tag, created_at)
    SELECT 'default', m.id, tags.tag, m.created_at FROM materials m, LATERAL regexp_split_to_table(m.search, chr(10)) AS tags (tag)
    WHERE tags.tag NOT LIKE 'sample%';
INSERT INTO queue_shares (tenant, share, next_rank, used_at)
    SELECT 'default', 'address ' || i, :jobs * 2, pg_temp.now_ms() - 1000 * i FROM generate_series(1, LEAST(:jobs / 10, 20000)) AS i;
INSERT INTO jobs (id, tenant, share, frame, measurement, needs, state, rank, progress, attempts, epoch, worker, lease_until,
    not_before, material, report, created_at, updated_at)
    SELECT overlay(overlay(overlay(overlay(lpad(to_hex(i), 12, '0') || substr(md5(i || 'id'), 1, 20) placing '-' from 9 for 0)
            placing '-' from 14 for 0) placing '-' from 19 for 0) placing '-' from 24 for 0),
        'default', 'address ' || i % 50, repeat(md5(i || 'frame'), 5), source, CASE WHEN ended THEN NULL ELSE source END,
        state, 2 * i, CASE WHEN ended THEN 1 ELSE 0 END, 1, 1,
        CASE WHEN state = 'running' THEN 'worker ' || i % 100 END, CASE WHEN state = 'running' THEN CASE WHEN i % 2 = 0 THEN at + 600000 ELSE pg_temp.now_ms() + 86400000 END END, at,
        CASE WHEN state = 'succeeded' AND i % 100 <> 0 THEN pg_temp.digest('material', 1 + i % :materials) END,
        CASE WHEN state = 'succeeded' AND i % 100 = 0 THEN pg_temp.digest('report', i) END, at, at + 1000
    FROM (SELECT i, state NOT IN ('queued', 'running') AS ended, state, pg_temp.digest('measurement', 1 + i % :materials) AS source,
            pg_temp.now_ms() - CAST((:jobs - i) * (60 * 86400000.0 / :jobs) AS BIGINT) AS at
        FROM (SELECT i, CASE WHEN i > :jobs - LEAST(:jobs / 50, 10000) THEN 'queued'
                WHEN i > :jobs - LEAST(:jobs / 50, 10000) - LEAST(:jobs / 50, 1000) THEN 'running'
                WHEN i % 5000 = 7 THEN 'dead' WHEN i % 20 = 1 THEN 'failed' WHEN i % 25 = 2 THEN 'cancelled'
                ELSE 'succeeded' END AS state
            FROM generate_series(1, :jobs) AS i) AS states) AS rows;
INSERT INTO idempotency_keys (tenant, name, body, job, created_at)
    SELECT 'default', 'key ' || id, md5(id) || md5(id), id, created_at FROM jobs ORDER BY created_at DESC LIMIT LEAST(:jobs / 2, 200000);
INSERT INTO intents (object, tenant, digest, bytes, expires_at)
    SELECT pg_temp.object('intent', i), 'default', pg_temp.digest('intent', i), 1000,
        pg_temp.now_ms() + CASE WHEN i % 100 = 0 THEN -1000 ELSE 3600000 END
    FROM generate_series(1, LEAST(:jobs / 10, 20000)) AS i;
INSERT INTO doomed (object, bytes, not_before)
    SELECT pg_temp.object('doomed', i), 1000,
        pg_temp.now_ms() + CASE WHEN i % 100 = 0 THEN -1000 ELSE 3600000 END
    FROM generate_series(1, :jobs / 5) AS i;
INSERT INTO unnamed (tenant, digest, not_before)
    SELECT 'default', pg_temp.digest('material', i), pg_temp.now_ms() + CASE WHEN i % 100 = 0 THEN -1000 ELSE 3600000 END
    FROM generate_series(1, LEAST(:jobs / 10, :materials)) AS i;
SET session_replication_role = origin;
