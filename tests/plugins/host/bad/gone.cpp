extern "C" __attribute__((visibility("default"))) int rhec_test_gone() { return 1; }
