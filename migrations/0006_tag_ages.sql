-- The time of a material beside each of its tags, so that the list of a tag is read in order and costs its page.
-- Programs of the schema before leave it empty; the next sweep writes it, and lists find such tags until then.
ALTER TABLE material_tags ADD COLUMN created_at BIGINT;
