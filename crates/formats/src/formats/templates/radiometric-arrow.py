# Writes measurement.arrow: a BRDF, one row for each pair of directions, one list of float32 for its spectrum.
# Needs pyarrow and numpy. The header keys and the columns are those of radiometric-csv.
import numpy as np
import pyarrow as pa

wavelengths = np.arange(400, 701, 10)
# One entry for each pair of directions, in degrees, in any order; replace these by yours.
theta_i, theta_o, phi_o = (axis.ravel() for axis in np.meshgrid(
    [0.0, 30.0, 60.0], [0.0, 20.0, 40.0, 60.0, 80.0], [0.0, 45.0, 90.0, 135.0, 180.0], indexing="ij"))
# [pairs, wavelengths]; NaN = missing.
values = np.full((len(theta_i), len(wavelengths)), 0.1, dtype=np.float32)

table = pa.table({
    "theta_i": theta_i,                         # from the normal; no column phi_i: isotropic
    "theta_o": theta_o,                         # over 90 for transmission
    "phi_o": phi_o,                             # counter-clockwise from the incoming azimuth
    "values": pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), len(wavelengths)),
}).replace_schema_metadata({
    "quantity": "brdf",                         # spectrum, reflectance, emission, brdf, btdf, bsdf, phase
    "value_unit": "1/sr",
    "cosine_included": "false",                 # true: the values hold |cos theta_o|, which is divided out
    "angle_unit": "deg",
    "wavelength_unit": "nm",
    "wavelengths": " ".join(map(str, wavelengths)),
    "isotropic": "true",
    "phi_o_extent": "mirrored",                 # 0 to 180 measured, the other half is its mirror image
    "sample": "velvet-03",
})
with pa.OSFile("measurement.arrow", "wb") as file, pa.ipc.new_stream(file, table.schema) as writer:
    writer.write_table(table, max_chunksize=100_000)
