// Nothing: tests_that_compute, whose source this is, holds precompiled headers.
