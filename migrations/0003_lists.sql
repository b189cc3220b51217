-- Indexes for the filters of lists, so that a page of a list costs the page. They change nothing that a program sees.
-- On PostgreSQL a catalog that holds rows gets each of them before this migration, by CREATE INDEX CONCURRENTLY, which
-- blocks no writer; each statement is one line for that.
CREATE INDEX IF NOT EXISTS jobs_by_measurement ON jobs (tenant, measurement, created_at, id) WHERE measurement IS NOT NULL;
CREATE INDEX IF NOT EXISTS materials_by_quantity ON materials (tenant, quantity, created_at, id);
CREATE INDEX IF NOT EXISTS material_tags_by_tag ON material_tags (tenant, tag, material);
CREATE INDEX IF NOT EXISTS measurements_by_quantity ON measurements (tenant, quantity, created_at, id);
CREATE INDEX IF NOT EXISTS measurements_by_format ON measurements (tenant, format, created_at, id);
