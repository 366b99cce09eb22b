# The list of fuzzers, for their build and for the tests; the seeds of each are in corpus/NAME.
set(VSPLAT_FUZZ_TARGETS checkpoint colmap colmap_points fit_checkpoint gltf_splats kernel_cache model pickle picture_bmp picture_exr picture_jpeg
  picture_png picture_tiff picture_webp ply reader selection sog sog_meta splat spz torch_file train_config views_json)
