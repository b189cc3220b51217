-- Keys verify what they sign, and the audit trail is read by tenant and forgotten by age. Programs of the schema before
-- work with it.

-- Public half of the pair that follows from the secret of a key: it verifies signed links and tokens, and cannot make
-- them. NULL if the key signs nothing.
ALTER TABLE keys ADD COLUMN verifier TEXT;

-- Limits of a tenant; NULL is no limit. They replace those of 0002, which were never kept to.
ALTER TABLE tenants ADD COLUMN most_bytes BIGINT;
ALTER TABLE tenants ADD COLUMN most_materials BIGINT;
ALTER TABLE tenants ADD COLUMN most_queued BIGINT;
-- Time at which everything that the tenant has was last counted.
ALTER TABLE tenants ADD COLUMN counted_at BIGINT NOT NULL DEFAULT 0;
ALTER TABLE usage ADD COLUMN materials BIGINT NOT NULL DEFAULT 0;

CREATE INDEX IF NOT EXISTS keys_by_age ON keys (tenant, created_at, id);
CREATE INDEX IF NOT EXISTS audit_by_age ON audit (at);
CREATE INDEX IF NOT EXISTS shares_by_reader ON shares (reader, material, tenant);
CREATE INDEX IF NOT EXISTS materials_public_by_age ON materials (created_at, id) WHERE visibility = 'public';
