FAST v8 INPUT FILE
FAST v8 certification test 10, UAE phase VI: old-NWTC/FAST, CertTest, commit 0badc8d0 (Apache-2.0), the lines that are read
                      25  TMax  -
                       1  CompElast  -
                       1  CompInflow  -
                       2  CompAero  -
                       1  CompServo  -
"ElastoDyn.dat"  EDFile  -
"UAE_VI/Test10_AD15.ipt"  AeroFile  -
                     0.1  DT_Out  -
                       5  TStart  -
