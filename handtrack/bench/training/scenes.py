"""What the network of the shape cue learns from: rendered hands before anything.

A hand of any tone, creased and lit like skin (:mod:`handtrack.bench.training.skin`), with its bare
arm or in a sleeve, at any size, whole, cut by the frame or half hidden, over a ground
(:mod:`handtrack.bench.training.grounds`), then blurred or sharpened, dimmed, tinted, noisy and
packed like the pictures of a cheap camera.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.bench.training.exposure import packed
from handtrack.bench.training.grounds import (
    SIDE_PX,
    Image,
    Pixels,
    noise,
    sloped,
    some_colour,
    some_shape,
    some_skin,
    texture,
)
from handtrack.bench.training.skin import as_skin
from handtrack.evidence.candidates import skin_log_odds
from synth.pictures import BRIGHTNESS, PALM_PX, Picture
from synth.pictures import SIDE_PX as PICTURE_PX

#: Length of a palm in a scene.
PALM_RANGE_PX = (14.0, 80.0)
#: How often there is none, one, or another behind it.
HANDS = (0.06, 0.84, 0.1)
#: Share of the hands before which everything has their colour, and of those that have the colour of
#: something behind them, a face's if there is one.
_ALIKE, _BORROWED = 0.28, 0.2
#: Share of the hands that look as if of skin; the others are as smooth as they were rendered.
_CREASED = 0.6
#: Share of the hands that throw a shadow on what is behind; how far it is off and how soft its rim
#: is, in pixels, and how dark it is.
_SHADOWED = 0.4
_SOFT, _HARD = (6.0, (1.0, 6.0), (0.1, 0.6)), (14.0, (0.5, 2.0), (0.3, 0.75))
_LUMA = BRIGHTNESS.astype(np.float32)
_SIZE = (SIDE_PX, SIDE_PX)
_XY = np.mgrid[:SIDE_PX, :SIDE_PX][::-1].astype(np.float32)


@dataclass(frozen=True, eq=False)
class Scene:
    """What the network sees, and what it should say."""

    seen: Pixels  # (SIDE_PX, SIDE_PX, 3)
    skin: Image  # (SIDE_PX, SIDE_PX), share of a pixel that is hand or bare forearm


@dataclass(frozen=True, eq=False)
class _Layer:
    """A hand to be laid over a picture."""

    colour: Image  # (SIDE_PX, SIDE_PX, 3)
    shown: Image  # (SIDE_PX, SIDE_PX), share of a pixel that it covers
    skin: Image  # and that it covers with skin


def scene_from(hands: list[Picture], grounds: list[Pixels], rng: np.random.Generator) -> Scene:
    """A scene of some of the hands before one of the grounds."""
    ground = grounds[rng.integers(len(grounds))]
    turned = np.rot90(ground, k=int(rng.integers(4)) if rng.random() < 0.3 else 0)
    flipped = turned[:, ::-1] if rng.random() < 0.5 else turned
    image: Image = np.ascontiguousarray(flipped, np.float32) * np.float32(rng.uniform(0.5, 1.3))
    skin: Image = np.zeros(_SIZE, np.float32)
    for _ in range(rng.choice(len(HANDS), p=HANDS)):
        hand, grain = hands[rng.integers(len(hands))], grounds[rng.integers(len(grounds))]
        image, skin = _with_hand(image, skin, hand, grain, rng)
    if rng.random() < 0.1:
        before = some_shape(rng) > 0
        image, skin = np.where(before[..., None], texture(rng), image), skin * ~before
    return Scene(_taken(image, rng), np.asarray(skin, np.float32))


def _with_hand(
    image: Image, skin: Image, picture: Picture, grain: Pixels, rng: np.random.Generator
) -> tuple[Image, Image]:
    kind, light = rng.random(), None
    tone = some_skin(rng) if rng.random() < 0.92 else np.maximum(some_colour(rng) / 255, 0.05)
    if kind < _BORROWED:
        tone = np.maximum(_most_like_skin(image, rng), 8) * np.exp(rng.normal(0, 0.05, 3))
        light = float(tone @ _LUMA) * np.exp(rng.normal(0, 0.2))
    tone = tone / (tone @ _LUMA)
    if kind > 1 - _ALIKE:
        image = (image @ _LUMA)[..., None] * tone * np.exp(rng.normal(0, 0.04, 3))
    hand = _hand(picture, tone, light, grain, rng)
    if rng.random() < _SHADOWED:
        image = _shadowed(image, hand.shown, rng)
    if rng.random() < 0.1:
        hand = _smeared(hand, rng)
    left = 1 - hand.shown
    return image * left[..., None] + hand.colour * hand.shown[..., None], np.maximum(
        skin * left, hand.skin
    )


def _most_like_skin(image: Image, rng: np.random.Generator) -> Image:
    """The colour ``(3,)`` of one of a few places of an image that comes nearest to skin's."""
    x, y = rng.integers(0, SIDE_PX, (2, 12))
    colours = np.clip(image[y, x], 0, 255)
    return np.asarray(colours[skin_log_odds(colours[None].astype(np.uint8))[0].argmax()])


def _hand(
    picture: Picture, tone: Image, mean: float | None, grain: Pixels, rng: np.random.Generator
) -> _Layer:
    """A hand of a tone and, if it is given, of a mean brightness, put somewhere.

    In half of the cases its arm is in a sleeve or away.
    """
    alpha, light, to_picture = _placed(picture, rng)
    light = 255 * np.clip(light / 255, 0, 1) ** rng.uniform(0.6, 1.6) * rng.uniform(0.35, 1.4)
    if mean is not None and (inside := alpha > 0.5).any():
        light = light * mean / max(float(light[inside].mean()), 1.0)
    blotches = noise(rng, rng.uniform(3, 40)) * np.array([1, 0.5, 0.5], np.float32)
    colour = light[..., None] * tone * (1 + rng.uniform(0, 0.1) * blotches)
    if rng.random() < _CREASED:
        palm_px = PALM_PX / float(np.hypot(*to_picture[:2, 0]))
        colour = colour * as_skin(palm_px, grain, rng)
    shown, skin = alpha, alpha
    if rng.random() < 0.5:
        arm = _arm(picture, to_picture, rng)
        shown, skin = alpha * ~arm, alpha * ~arm
        if rng.random() < 0.75:
            inside = alpha > 0.5
            shade = light / max(float(light[inside].mean()) if inside.any() else 1.0, 1.0)
            colour = np.where(arm[..., None], texture(rng) * shade[..., None], colour)
            wider = int(rng.integers(2, 9)) if rng.random() < 0.5 else 1
            sleeve = cv2.dilate(alpha * arm, np.ones((wider, wider), np.uint8)) * arm
            shown = np.maximum(alpha, sleeve)
    return _Layer(np.clip(colour, 0, 255), shown, skin)


def _placed(picture: Picture, rng: np.random.Generator) -> tuple[Image, Image, Image]:
    """Coverage and brightness of a hand put somewhere, and the map ``(2, 3)`` to its picture.

    What the picture cuts off of an arm is drawn out to the frame.
    """
    palm = np.exp(rng.uniform(*np.log(PALM_RANGE_PX)))
    step = PALM_PX / palm
    turn = rng.uniform(-np.pi, np.pi) if rng.random() < 0.35 else rng.normal(0, 0.5)
    mirror = rng.choice([-1.0, 1.0])
    c, s = step * np.cos(turn), step * np.sin(turn)
    M = np.array([[mirror * c, -mirror * s], [s, c]])
    room = max(SIDE_PX / 2 - 1.1 * palm, 6.0)
    at = SIDE_PX / 2 + rng.uniform(-room, room, 2) + rng.normal(0, 4, 2)
    centre = np.full(2, PICTURE_PX / 2) if rng.random() < 0.5 else picture.at_px
    A = np.column_stack([M, centre - M @ at])
    # brightness is premultiplied: both are averaged, then divided
    layers = np.dstack([picture.grey, picture.alpha])
    if step > 1:
        layers = np.asarray(cv2.GaussianBlur(layers, (0, 0), 0.45 * step), np.uint8)
    flags, border = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, cv2.BORDER_REPLICATE
    seen = cv2.warpAffine(layers, A, _SIZE, flags=flags, borderMode=border)
    alpha = seen[..., 1].astype(np.float32) / 255
    return alpha, seen[..., 0] / np.maximum(alpha, 0.05), A


def _arm(picture: Picture, to_picture: Image, rng: np.random.Generator) -> NDArray[np.bool_]:
    """What lies below a sleeve's end, ``(SIDE_PX, SIDE_PX)``."""
    along = picture.R[:2, 1] / max(float(np.linalg.norm(picture.R[:2, 1])), 0.3)
    x, y = np.tensordot(to_picture[:, :2], _XY, axes=1) + to_picture[:, 2, None, None]
    up = (x - picture.at_px[0]) * along[0] + (y - picture.at_px[1]) * along[1]
    return np.asarray(up < -PALM_PX * rng.uniform(0.55, 1.8), bool)


def _shadowed(image: Image, shown: Image, rng: np.random.Generator) -> Image:
    """``image`` under the shadow of what is shown: soft and near, or hard and farther off."""
    far, soft, dark = _HARD if rng.random() < 0.4 else _SOFT
    shift = np.array([[1, 0, rng.normal(0, far)], [0, 1, rng.normal(0, far)]])
    moved = cv2.warpAffine(shown.astype(np.float32), shift, _SIZE)
    cast = cv2.GaussianBlur(moved, (0, 0), rng.uniform(*soft))
    return image * (1 - rng.uniform(*dark) * cast[..., None])


def _smeared(hand: _Layer, rng: np.random.Generator) -> _Layer:
    """A hand in motion."""
    length = int(rng.integers(3, 12))
    kernel = np.zeros((length, length), np.float32)
    end = int(rng.integers(0, length))
    cv2.line(kernel, (0, end), (length - 1, length - 1 - end), 1.0)
    kernel /= kernel.sum()

    def smear(image: Image) -> Image:
        return np.asarray(cv2.filter2D(image.astype(np.float32), -1, kernel), np.float32)

    return replace(hand, colour=smear(hand.colour), shown=smear(hand.shown), skin=smear(hand.skin))


def _taken(image: Image, rng: np.random.Generator) -> Pixels:
    """The picture that a camera makes of it."""
    image = image * np.exp(rng.normal(0, 0.12, 3) + rng.normal(0, 0.2))
    if rng.random() < 0.3:
        image = sloped(image, rng, 0.4)
    if rng.random() < 0.3:
        image = 255 * np.clip(image / 255, 0, 1) ** rng.uniform(0.6, 1.8)
    if rng.random() < 0.4:
        image = _blurred(image, rng.uniform(0.4, 1.6))
    elif rng.random() < 0.5:
        image = image + rng.uniform(0.3, 2.0) * (image - _blurred(image, rng.uniform(0.8, 3.0)))
    if rng.random() < 0.4:
        image = _saturated(image, 0.0 if rng.random() < 0.2 else np.exp(rng.normal(0, 0.4)))
    image = image + rng.uniform(0, 9) * rng.standard_normal(image.shape, np.float32)
    pixels = np.clip(image, 0, 255).astype(np.uint8)
    if rng.random() < 0.3:
        pixels = packed(pixels, int(rng.integers(20, 80)))
    return pixels


def _blurred(image: Image, by_px: float) -> Image:
    return np.asarray(cv2.GaussianBlur(image.astype(np.float32), (0, 0), by_px), np.float32)


def _saturated(image: Image, share: float) -> Image:
    """An image with so much of its colours."""
    grey = np.repeat(image @ _LUMA[:, None], 3, axis=-1)
    return np.asarray(grey + share * (image - grey), np.float32)
