"""Motion as text: ASF, AMC and BVH.

``rows`` finds tokens and learns the patterns that lay them out, ``layout`` has these patterns,
``notes`` the frames that deviate from them.
"""
