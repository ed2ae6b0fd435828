"""What items of a batch do, apart from the tests: other processes import it, and no pytest."""

import os
import time

from motionary.errors import UnreadableFile


def slow_square(n):
    time.sleep(0.02 * (n % 3))
    return n * n


def refuse_three(n):
    if n == 3:
        raise UnreadableFile(f"file {n}: broken")
    return n


def divide_by_zero(n):
    return 1 // (n - 2)


def recurse(n):
    return recurse(n) if n == 2 else n


def need_too_much(n):
    if n == 2:
        raise MemoryError
    return n


class Unsendable(Exception):
    def __init__(self, first, second):
        super().__init__(first)


def raise_what_cannot_be_sent(n):
    if n == 2:
        raise Unsendable("one line\nand another", second=lambda: n)
    return n


def return_what_cannot_be_sent(n):
    return (lambda: n) if n == 2 else n


def end_process(n):
    if n == 2:
        os._exit(9)
    return n


def stop(n):
    raise KeyboardInterrupt
