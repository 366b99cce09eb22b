// Intentionally empty: the only source of the target tests_that_compute, which holds the precompiled headers.
