"""What is packed here, any zlib reader unpacks."""

from __future__ import annotations

import zlib
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.recording.deflate import LONGEST_CODE, canonical_codes, code_lengths, deflate


@settings(deadline=None)
@given(st.binary(min_size=1, max_size=400))
def test_any_bytes_come_back(content: bytes) -> None:
    assert zlib.decompress(deflate(np.frombuffer(bytearray(content), np.uint8))) == content


@pytest.mark.parametrize("size", [1, 2, 3, 65_535, 65_536, 100_001])
def test_long_and_uneven_content_comes_back(size: int) -> None:
    content = np.random.default_rng(size).binomial(255, 0.02, size).astype(np.uint8)
    assert zlib.decompress(deflate(content)) == content.tobytes()


def test_bytes_so_rare_that_their_codes_would_be_too_long_come_back() -> None:
    """Counts that double give codes of 21 bit where the format allows 15."""
    content = np.concatenate([np.full(2**k, k, np.uint8) for k in range(22)])
    assert zlib.decompress(deflate(content)) == content.tobytes()


@settings(deadline=None, max_examples=15)
@given(st.lists(st.integers(0, 10**6), min_size=257, max_size=257))
def test_codes_are_complete_and_none_begins_another(counts: list[int]) -> None:
    """Kraft's sum is one, and the lowest bits of no code are another code."""
    occurrences = np.array(counts)
    occurrences[:2] += 1
    lengths = code_lengths(occurrences)
    assert ((lengths > 0) == (occurrences > 0)).all()
    assert lengths.max() <= LONGEST_CODE
    assert np.sum(0.5 ** lengths[lengths > 0]) == 1.0
    codes = canonical_codes(lengths)
    texts = sorted(
        f"{int(code):0{length}b}"[::-1]
        for code, length in zip(codes, lengths, strict=True)
        if length
    )
    assert not any(b.startswith(a) for a, b in pairwise(texts))


def test_it_is_as_small_as_zlib_without_a_search_for_repeats() -> None:
    content = np.random.default_rng(1).normal(0.0, 3.0, 200_000).astype(np.int8).view(np.uint8)
    packer = zlib.compressobj(9, zlib.DEFLATED, 15, 9, zlib.Z_HUFFMAN_ONLY)
    theirs = packer.compress(content) + packer.flush()
    assert len(deflate(content)) <= 1.01 * len(theirs)
