"""The known answers, written by ``tools/known_answers.py``."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class KnownAnswer:
    """16 frames as stored by a version of a codec, in hex, and the SHA-256 of their values."""

    version: int
    grouping: str
    header: str
    streams: tuple[str, ...]
    sha256: str
    models: tuple[tuple[int, str], ...] = ()  # kind and data


# fmt: off
ANSWERS = {
    "raw": KnownAnswer(
        0, "joint",
        "",
        (
            (
                "000000000000000003000000b80b00e02e0078690080bb00f82401e0a501383e0200ee0238b5"
                "03e09304f8890580970678bc07e0f808b84c0a6c0200000000000003bc0700000000ca0800ae"
                "2900185b00d2a000a6fe00006d01aaef016e8a02b8350352f50306cd0440b50594b5066ec607"
                "1c02000000000000034420008a0700000000a60900b22000b84c00ee890054d800203401e6a4"
                "01dc260238b6028e5a03141004cad604e6aa05da02000000000000036e3c00c01c0058070000"
                "0000b80600801b00583e00406f0038ae0040fb0058560180bf01b83602cabf022253038af403"
                "dc0000000000000003a456007832007215002607000000009407004e1600c233005c5800e687"
                "002ac600940b01b85f0102bb01062502309602b60300000000000003f25d00883b00ee200024"
                "0e002a0300000000dc0000520d00982100ae3d0094610080890006bd005cf800823b01788601"
            ),
            (
                "0a00000000000000025654b83d0028f816a00af80200008205ea0b0217ca26423b6a540c7694"
                "98ccbf3601000000000000021225b61cea15e40c38095203c60200009402ee02a2081c0cf014"
                "8a1b7e27383100ceffffffffffff020000260cbc16c21f38271e2d74313a3470354c31622fe8"
                "2bde2644201a18600e"
            ),
            (
                "2842ffffffffffff020000b22aea4c726a4a833c9bb4aa7cb594bbc6c07ebd86b5dea8509b48"
                "85906a6079feffffffffff03000000b44b00988f00e2c70026fc009a28017449014866018277"
                "01b684011a8a01e48301a87901d26301f649014a2801486afdffffffffff03000000f67200fc"
                "da00123801388a016ed101b40d020a3f02706502e680026c9102029702a891025e8102246602"
                "fa3f02"
            ),
            (
                "800bfcffffffffff0300000042a400aa360102bb011435024c9d0274f7025647035e850356b5"
                "0308db03e0ee03a8f4032af003d2d9036ab503a853faffffffffff0300000004d800d89e017c"
                "540226f5026a88037e0a049877044cd704d025055a5f057e8b0572a6056cac0500a505648c05"
                "6039f8ffffffffff03000000d01501861302ecfc0202d203c892043e3f0564d7053a5b06c0ca"
                "06f62507dc6c07729f07b8bd07aec70754bd07"
            ),
        ),
        "b56c0398be5f18ecf59ce7adf2b1b9932ad088a21d75451f804513bf46b91893",
    ),
    "fast": KnownAnswer(
        0, "joint",
        "",
        (
            (
                "08004108d0284008c08901400890fd013f0880de023e08d086033c9201e1eebbe75cc4ad8757"
                "08a729dc454220f524fa24a905e9280088f202809427ca0b0002c0933f790280272f00080029"
                "2fca0780282f000440ca3b7901e0c99fbc0078f20120004479511e809477f201f0e44f3e0029"
                "2fca0320e50540003cf9c90720e5054000297ff201f0e44e1e40ca8bf2004439a21cc0939f3c"
                "52f6e4271f409407009e2cca032080273f7929f7e40100"
            ),
            (
                "08c0d10239049099013704ffc7013546e04ee12d402688f041f66329cf397e2c0090d61f0780"
                "73fc380048eb8f53de397eecc949eb8f53de39386b009056e908c039fe3800a4f5c7527e8e3f"
                "c69349eb8fa5fc1cfd08"
            ),
            (
                "04aff7053b04bf9a0c3e08efd614404f00921580681790bd380f3f1f2eefbff2cc0d00fcca0b"
                "280070397ebe0000e7e1cc05007ee50206007ec5990b009773010300e7f1f303805f71e602c0"
                "af5cc000b81c672e009cc7050c805ff1f30100"
            ),
            (
                "04ffd11f4208afb12d4308bf9a3e445600122200448003045d9d1df14c0aa7b73fb800809407"
                "17a993870080b363944700c00f7ef208005ca4278f0080b323ca0b00fce0274f0070919e3c01"
                "80b323ca07801ffce405808bf4e40500ce4e940f003ff8e40500"
            ),
        ),
        "b56c0398be5f18ecf59ce7adf2b1b9932ad088a21d75451f804513bf46b91893",
    ),
    "best": KnownAnswer(
        0, "all",
        "",
        (
            (
                "0108004108d0284008c08901400890fd013f0880de023e08d086033c08c0d102390490990137"
                "04ffc7013504aff7053b04bf9a0c3e08efd6144004ffd11f4208afb12d4308bf9a3e44e402ee"
                "73c73e5fcb6bf9b97527138ec8d3ead1779504233d77dd6b7f1c02699ae1b5e34982868df383"
                "5fd7e3850c1b86d9a59e0404a2823ede01570fe13123c313f908f8921cc70581832e90b6dd61"
                "8e6bc2711cb3441230069112ca1e98373ed6751c018d4964891195108fd0c0de2876212ea185"
                "3915798228a25b03fe7d94784884fe3a0cb1ec8e87d5a3181bdb2ff876f645076574f9ace0bc"
                "f717935c3d733f8749dfd7d046afef4234906551b750d2cabf478316698446f858a728ab9af1"
                "1e4c6bd12466604043e353ea4d1e14a0ad8d874dcf02ec4ca33fad1ff9239058c65b766afdb2"
                "f9555ef2087f5402aa8f71cc36623a4d02633a6a2534aea85c7e32ed18c9fdbfe1d482b3ee77"
                "a39eff731d6ac3433852657673df002eb1d6ad786164bf798527c40a7d4235177bb957276437"
                "592d3a42a774bf4e8870693ac729d27b74b8e03fe7052baef96466efdbd1a7c59826a86ffcdf"
                "744f60cefa0be80eb61e0696aa"
            ),
        ),
        "b56c0398be5f18ecf59ce7adf2b1b9932ad088a21d75451f804513bf46b91893",
    ),
    "posewave": KnownAnswer(
        0, "all",
        "0201000c8fc2753d00004040488b94020a0000000000",
        (
            (
                "00ff74ea5cbed9593a437e249c483e0d9d5bb5adaff5478e65552a67d8a5bd1b2d7cb42021af"
                "0b1fc885bad36b10372400da9b822e3f1f2353d270138ce7fa25c2a35bc32d8885"
            ),
            "98b83fd29fd367a47ddd273e2d851863570883b8383d3d387ae4",
            "11cc09d56380ccaf28f7120f673e556738b8",
        ),
        "85c38b8d62e243fc877a2a69fac81e85c8d531a05d32b545cc07670f48b71cdf",
    ),
    "mrdwt": KnownAnswer(
        0, "channel",
        "0a0010ff000000000000d03f01",
        (
            "857b00971513c3b19c0b569f",
            "857b04c0bf7b61d62b414b",
            "857b1061622c6e3ee86dec82",
            "837d143f329109a06e7f",
            "837d1c326e7889a433fb",
            "80820e18ca636392",
            "807f141b85135bac",
            "808008605ebe05",
            "008205b52faf",
            "008a05b56105",
            "008a0d3ecb5f37",
            "0090077fb1ed",
            "8380cf01052e0b42cb7b35",
            "8480a902056319079f6800d1",
            "84809703021dc248b10790d7",
        ),
        "d3f8addc242a5633957b199faef3c49af0f2bd64fa7dfa0a43efb51a906ce612",
    ),
    "dwt": KnownAnswer(
        0, "channel",
        "0a0010ff000000000000d03f01",
        (
            "838000ba575e7ba7c5a4",
            "8280028b2ca51538f1",
            "8280084780687a1ead18",
            "82800c4a6a99bf9e29",
            "828012361298792845",
            "80801410589ef63f48",
            "8080121b6b54f7d0",
            "808008605ebe05",
            "80800985c8fc",
            "80802513fec4d589",
            "82804f125c0dc83f1d",
            "8280870106d3bf4b1da3",
            "8380cf01052e0b42cb7b35",
            "8480a902056319079f6800d1",
            "84809703021dc248b10790d7",
        ),
        "20f705949f813e29f1809f29df9bc3dc2319c3037aee350b85415e25d05c8d86",
    ),
    "awt": KnownAnswer(
        0, "channel",
        "0a0010ff0b81fb17d394404001",
        (
            "007b00edc6bd",
            "007c00f636",
            "007b00f89f02",
            "007d00fc97",
            "007d00fdd4",
            "",
            "",
            "",
            "",
            "",
            "",
            "",
            "008001d45f",
            "008001ee3f",
            "008101f304",
        ),
        "2030a2f27596de0fc9d8e7a3da6577570011cafa5c63bfcb0ca64123ddd32387",
    ),
    "qbc": KnownAnswer(
        0, "joint",
        "2810ff000000000000e83fd2b6514ca8b7e83f",
        (
            "0bffffbefebea6ea0bbd9d3b",
            "02f5fbec6a18",
            "07f1769d43286a",
            "0ce78e5ae3b554a020",
            "000a15c7d8a28e37",
            "00050aba6f",
            "0008292738",
            "000b27ac09",
        ),
        "6cde9cb995ddb2f74677c732a833f20af0b2208fc86c74e6a4243052ad30c602",
    ),
    "pca": KnownAnswer(
        0, "all",
        "ff",
        (
            (
                "551f0e121109080808080807070707060395970e0d0d0c0c0c0a0a0a0a0803275231cf63e760"
                "85e53c437e215b40f7d2cc780d54a9a4adf9223126a2f2039ba8f77dc4470b6ac04a85850b79"
                "85be2fdcafa719a6ad46601ae661a94798eeb90e0af84180afe30218e93b84fc8d309bfed839"
                "ec5c48767601a8769c82196dc5d991c9ac13a7a265f9609a796fb07dac8454ca2793096a630a"
                "10f4e314db7ce0c5cf5ce6854baee8ee0231530c423e082bba3762a57bbd51b35224c1c9835f"
                "6dc4e8d8a7ec277dfe8e226aa4e24949f11093bee0df4d705a23ea8fd788606a6b5843671d5e"
                "5a51b75503c9d00582835ebc979092a1ea5e6faa0a35b900afa494d6936d63bc3b036b336ce1"
                "bd529c7f64e49de941ffe0117eac6b20af4d4a912ec8b97d95157a9fefffb16d4fa6cbb2e174"
                "10826e2b36a8d5ac9a268ff0e9e2c8cdbdd9e77c837e59a9606bc13f6cc3c4469fde16718aff"
                "188634a7a5c68a07c4779bb55a754ce0483843ecb2995a0735a4f8d353112a9c2c14d186925c"
                "e2208decf3b9ca50a16cb69c770dce17f4f855ea388ca3b0b2a771cbed21888b1bc5b18c56a4"
                "a393abad8ed1a3d1be9ac816a7fea777f4d7af06dc3c44e9ce21f1d5fdff89edb18f7ab512ab"
                "a06653d1713894db1ad47d3310078d2d70751d94cf4268bcaa82f49f978fdb876a385241f9e7"
                "6351c3910b50fe27e307c0b5f588f881807c43df2f78546f4389a052000d06d926d5bc62e22e"
                "f321128df79904"
            ),
        ),
        "c93a43f076c371d9f2ca16cf76af35367bffeccf980a27da9235ca5d0db479fb",
    ),
    "lsdt-frame": KnownAnswer(
        0, "all",
        "02009a9999999999c93f0f7b7b7b7d7d827f80828a8a9080808000",
        (
            (
                "287455a56cc616080cc5803855a75e8fcb619c291ca42747cbae246427d30306d952a974a1cd"
                "67f213abd00e003bde1ce80b01e1d393ed443a1ac768bc63fb70f50e6aae87f8f57c84c686d3"
                "3dc1d0b9b8261dfa8997c60333ba170dfb49e870ed496d040e12e472f63fec87ece00ea4f2c5"
                "1cc3bd590b4493cc629804a89f"
            ),
        ),
        "0d9c44ecb03edc5ff8945045c98637452fd2c76869baddc7b882a5ff5c3e43f6",
    ),
    "lsdt-clip": KnownAnswer(
        0, "all",
        "f001f00102009a9999999999c93f0f7b7b7b7d7d827f80828a8a9080808000",
        (
            (
                "707a2e671bb04d853303669179a23c7e57d41fbf56e179a33a9d3a41a9d3e3e78c341ed57621"
                "1d87cbcfb536ca84938e92b5f9b3019087750de96eb269ad584249f096c01d80ba2841fe167f"
                "cd35ca53ebcbbdcf2b6a5936bfe3193af1e29415a82bbedc0067c7bb50c889acd022d4aede"
            ),
        ),
        "0a69e4e23706a6e38c7b173bddfbb530cc286da99afbdcf43858e383c86d7485",
    ),
    "mdtt": KnownAnswer(
        0, "all",
        (
            "10100201263c3c166dbe806db82b8c56750715a89a9999999999c93f0f7b7b7b7d7d827f80828a8a"
            "9080808000"
        ),
        (
            "2679040d9f644530bd70c74f720cab717fd979b5d32b7e687657c050ed0859b4674847a36cb2c5",
        ),
        "85769f1efc31bbb040a147754ba4a820b89f292d9179b35eed7e9d7e4970bb7a",
        (
            (1, (
                "010f030a09061ed2490f4d8f30f94fb1819cd8109cfcb375dd70fe364721ddbc4b05d8ebdd69"
                "adbdf9628020e604caf6"
            )),
        ),
    ),
    "pca-rdo": KnownAnswer(
        0, "all",
        (
            "10020e0124c84b4235e8797a3d0c43888b34f4249a9999999999c93f0f7b7b7b7d7d827f80828a8a"
            "9080808000"
        ),
        (
            "06a0f44b67dafb",
        ),
        "108de800d0ba0811535817b641004d5dff8e9ecb1ef9c0bdce38ff70cb4b4b64",
        (
            (1, (
                "030f020a0810020a080f010620f981a529468f14363c4b2ce4b10bb22c2f41a1b8f83a16a8ea"
                "12c2d4e86533562effc3909f2f3c5d871c73075d293b147859c56edf01e6e39659ae1489b07e"
                "2dd18c08a37850b2325128670a36b5d99c404a59"
            )),
        ),
    ),
    "online": KnownAnswer(
        0, "all",
        "02009a9999999999c93f0f7b7b7b7d7d827f80828a8a908080800000",
        (
            (
                "4283484bf4174e6b89ba8e32fe6fc1cefbf109cd77c72e8d8e1a6a3f51ceacadb3a8c291b577"
                "5875345b07412fb8b6b36ba67b28656828433bbe2f4c2830056ed45d2fcc222391e8e7db0e4c"
                "8b6f22b81160ab8d28a0ead82a0c47d07a4437765f839fc2f0beb52a1ab7ec28b83322a62408"
                "343198e5f9ad7a4dcc2807c3ea16728348aa1d42"
            ),
        ),
        "5f63a826fdbb5e06ba634896efbedc2911c51630fcca8a26907ba737c52a160d",
    ),
}
