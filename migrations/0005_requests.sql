-- Limit on the requests of a tenant. Programs of the schema before do not keep to it.

-- Upper bound on the requests of the tenant to each process within a minute; NULL is no limit.
ALTER TABLE tenants ADD COLUMN most_requests BIGINT;
