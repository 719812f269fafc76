"""How an input is changed at random: the bytes of a file in, others out, by a seeded generator."""
