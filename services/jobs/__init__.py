"""Jobs that commands, `slopewise.*`, fleet workers and the investigator share: plain arguments in,
a frozen result out. They read files; they print nothing and write no pages. Input that
cannot be used is an InputError that names file and field, or the option.
"""
