"""Models of the posteriors: which file serves which posterior.

- registration: `registration`; beside it `closed_form` (its posterior without a sampler).
- registration-distortion: `variants`, point by point; registration-mixture: `mixture`, likewise.
- registration-joint: `joint`, of two `registration`.
- All of these share `least_squares` (the published estimator) and `new_stars` (its consequences).
- centroid-noise: `centroid_noise`, with the printed digits of `rounded`.
- misalignment, misalignment-drift: `misalignment`, of the data in `lasers`; beside them
  `small_angle`, without a sampler.
- frame-averaging: `averaging`.
- table-5: `stage_table`, of `reference_angles`; beside it `table_sums`, without a sampler.
"""
