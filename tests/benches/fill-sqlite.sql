-- Fills an empty catalog on SQLite with :materials materials of one measurement each; :document is that of a material.
-- One in 5,000 is rare in its tag, another one in its quantity; those two are public, and shared with the tenant
-- `reader`.
INSERT INTO tenants (id, name, created_at) VALUES ('reader', 'reader', 0) ON CONFLICT DO NOTHING;
INSERT INTO materials (tenant, id, visibility, payload, quantity, bytes, name, search, document, created_at)
    WITH RECURSIVE numbers (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM numbers WHERE i < :materials)
    SELECT 'default', 'b3-' || lower(hex(randomblob(32))), CASE WHEN i % 5000 = 1 THEN 'public' ELSE 'private' END, 'payload',
        CASE WHEN i % 5000 = 0 THEN 'edf' ELSE 'brdf' END, 3000, 'sample ' || i,
        'sample ' || i || char(10) || 'common' || CASE WHEN i % 5000 = 1 THEN char(10) || 'rare' ELSE '' END, :document,
        1790000000000 + 1000 * i
    FROM numbers;
INSERT INTO material_tags (tenant, material, tag, created_at) SELECT tenant, id, 'common', created_at FROM materials;
INSERT INTO material_tags (tenant, material, tag, created_at)
    SELECT tenant, id, 'rare', created_at FROM materials WHERE search LIKE '%rare';
INSERT INTO material_sources (tenant, material, measurement)
    SELECT tenant, id, 'b3-' || printf('%064d', ROW_NUMBER() OVER (ORDER BY created_at) - 1) FROM materials;
INSERT INTO shares (tenant, material, reader, created_at)
    SELECT tenant, id, 'reader', 0 FROM materials WHERE visibility = 'public';
