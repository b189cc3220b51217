-- Indexes for the column of the migration before. They change nothing that a program sees. The index
-- material_tags_by_tag serves programs of the schema before, so that a later migration may remove it.
CREATE INDEX IF NOT EXISTS material_tags_by_age ON material_tags (tenant, tag, created_at, material);
CREATE INDEX IF NOT EXISTS material_tags_undated ON material_tags (tenant, material, tag) WHERE created_at IS NULL;
