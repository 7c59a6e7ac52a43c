"""Phrases that the project's prose avoids; see "Language" in CONTRIBUTING.md.

They match only two of 18,568 comments, sentences and strings of Box2D, ozz-animation and
meshoptimizer.
"""
import re

# Parts of the pattern for `3 bytes a pose`, which is written "3 bytes per pose".
NUMBER = (
    r'(?:\d[\d,.]*(?:\s*(?:to|-|–|and|or|%)\s*\d[\d,.]*)?|one|two|three|four|five|six|seven|eight|'
    r'nine|ten|twelve|sixteen|few|fewer|several|many|more|most|least|some|how (?:many|much)|'
    r'thousand|million|hundred)')
UNIT = (
    r'(?:bytes?|bits?|[kKMG]i?B|ns|us|µs|μs|ms|mm|cm|m|seconds?|minutes?|cycles?|instructions?|'
    r'allocations?|multiplications?|operations?|poses?|ticks?|steps?|frames?|messages?|requests?|'
    r'commands?|avatars?|sessions?|samples?|floats?|numbers?|values?|lines?|rows?|entries|threads?|'
    r'jumps?|walks?|tests?|joints?|degrees|radians|metres?|examples?|records?|attempts?|packets?|'
    r'batches|items?|calls?|columns?|parameters?|weights?|matrices|quaternions?|rotations?|'
    r'points?|vertices|triangles)')
DIVISOR = (
    r'(?:second|minute|hour|tick|frame|pose|joint|step|avatar|figure|core|processor|thread|shard|'
    r'line|row|page|world|session|client|connection|observer|movement|example|request|item|batch|'
    r'message|group|kind|lane|vector|file|test|part|parameter|pair|ring|machine|node|server|user|'
    r'subject|capture|library|degree|metre|meter|cell|column|table|field|cache|key|track|channel|'
    r'walk|jump|foot|leg|limb|sample|call|command|iteration|run|block|word|byte|value|weight|'
    r'point|vertex|subscription|record|crowd|bin|stage|piece)')
END = (
    r'(?=\s*(?:$|[.,;:()\[\]\-–—|"/+*]|(?:and|or|of|in|on|at|with|for|to|than|as|is|are|was|by|'
    r'from|if|when|while|but|so|each|less|more|over|instead|that|which|until|after|before|without|'
    r'where|long|per|plus|beside|most|first|it)\b))')

PATTERNS = {name: re.compile(pattern, re.I) for name, pattern in {
    '"who" without a noun before it':
        r"(?<![\w\"'’])(?:to|for|by|of|from|with|at|as|than|between|among|in|on|about|and|or|but|"
        r"that|if|when|because|only|not|even|also|is|are|tells?|lets?|serves?|makes?|leaves?|"
        r"keeps?|reaches?) who\b(?! (?:is|are) this\b)|"
        r"(?:^|(?<=[.!:;] )|(?<=[(|]))\s*who (?!(?:is|are|it is|should|can|does|makes) "
        r"(?:this|it|use|read|for)\b)(?!it is for)(?![^.!]*\?)(?=\w)",
    '"whoever"': r'\bwhoever\b',
    '"nobody"': r'\bnobody\b',
    '"tell" or "told" of a machine':
        r"\btold\b(?! (?:apart|otherwise|to)\b)|(?<!can )(?<!cannot )(?<!could )(?<!to )(?<!not )"
        r"(?<!n't )(?<!\bus )\btell(?:s|ing)? (?:what|which|how|whether|when|why|where|who|that|of|"
        r"nothing|more|less|only|no|all|everything|by|in|so|as|anything|it|its|this|these|their|"
        r"his|a|an|every|each|much|little)\b(?! apart)(?! to \w)",
    '"as many as"':
        r'\bas many as\b(?! (?:possible|necessary|needed|required|you)\b)(?! [\d~])|'
        r'\bas many (?:[\w-]+ ){1,6}as (?:may|might|wait|will)\b',
    '"anew" instead of "again"': r'\banew\b',
    '"till" instead of "until"': r'\btill\b',
    '"such as" without an example': r'\b(?:not|is|are|was|were|be|been|ones?) such as\b',
    '"work out" instead of "compute"':
        r'\bworked out\b|\bwork(?:s|ing)? (?:\w+ )?out (?:the|a|an|what|how|which|where|its|their|'
        r'it|them|all|every|each)\b|\bwork(?:s|ing)? (?:it|them|this|that) out\b',
    '"a" instead of "per"':
        rf'\b(?:{NUMBER}\s+(?:[\w-]+ ){{0,2}}?{UNIT}|bytes?|bits?|ns|us|µs|ms|[kKM]i?B) an? '
        rf'{DIVISOR}\b{END}|(?<![\w.])(?<!gives )(?<!give )(?:\d[\d,.]*|one|two|three|four) an? '
        rf'{DIVISOR}\b{END}',
}.items()}


def banned_phrases(text):
    """Yields (what is wrong, match) for every banned phrase of a prose_text.Text."""
    words = text.text
    if text.kind != 'message':  # Code and link targets are not prose.
        words = re.sub(r'\]\([^)]*\)', ']', re.sub(r'`[^`]*`', '`c`', words))
    words = ' '.join(words.split())
    for name, pattern in PATTERNS.items():
        if text.kind == 'heading' and name.startswith('"who"'):
            continue  # "Who should read this" is a usual heading.
        for match in pattern.finditer(words):
            yield name, match
